//! The numbers of a file that is text throughout, or text with binary parts.

use super::Fault;
use super::binary::{self, Order, Scalar};
use super::text::Text;
use std::fmt::Arguments;

/// Reads numbers one after the other, each with its place.
pub(super) struct Numbers<'a> {
    bytes: &'a [u8],
    /// Words and lines, whatever the form of the numbers.
    pub(super) text: Text<'a>,
    binary: Option<Order>,
    last: usize,
}

impl<'a> Numbers<'a> {
    /// Numbers in words, until [`Numbers::set_binary`].
    pub(super) fn new(bytes: &'a [u8], comment: Option<u8>) -> Numbers<'a> {
        Numbers {
            bytes,
            text: Text::new(bytes, comment),
            binary: None,
            last: 0,
        }
    }

    /// From here on numbers are binary.
    pub(super) fn set_binary(&mut self, order: Order) {
        self.binary = Some(order);
    }

    /// Whether numbers are binary.
    pub(super) fn is_binary(&self) -> bool {
        self.binary.is_some()
    }

    /// An error about the number read last.
    pub(super) fn fault(&self, message: impl Into<String>) -> Fault {
        self.fault_at(self.last, message)
    }

    /// An error about the number at an offset.
    pub(super) fn fault_at(&self, at: usize, message: impl Into<String>) -> Fault {
        if self.is_binary() {
            Fault::binary(at, message)
        } else {
            Fault::text(at, message)
        }
    }

    /// Before binary numbers: passes the end of the line that announces them.
    pub(super) fn start_block(&mut self) {
        if self.is_binary() {
            self.text.line();
        }
    }

    /// Checks that `count` things of at least `numbers` numbers, each of `size` bytes where binary, can follow.
    pub(super) fn can_follow(
        &self,
        count: usize,
        numbers: usize,
        size: usize,
        what: Arguments<'_>,
    ) -> Result<(), Fault> {
        // A number in a word takes a letter and a blank, except that the last needs no blank.
        let each = numbers.saturating_mul(if self.is_binary() { size } else { 2 });
        let left = self.text.remaining() + usize::from(!self.is_binary());
        if count.saturating_mul(each) > left {
            return Err(self.fault_at(
                self.text.at(),
                format!("{count} {what} are announced, but only {left} bytes follow; correct the count or restore the rest of the file"),
            ));
        }
        Ok(())
    }

    /// The next `size` bytes.
    fn bytes_of(&mut self, size: usize, what: Arguments<'_>) -> Result<&'a [u8], Fault> {
        let at = self.text.at();
        self.last = at;
        let bytes = self.bytes.get(at..at + size).ok_or_else(|| {
            Fault::binary(
                at,
                format!("the file ends where {what} is expected; it is cut off, or a count is too large"),
            )
        })?;
        self.text.go_to(at + size);
        Ok(bytes)
    }

    /// The next integer; `scalar` is its binary type.
    pub(super) fn integer(&mut self, scalar: Scalar, what: Arguments<'_>) -> Result<i64, Fault> {
        match self.binary {
            None => {
                let value = self.text.integer(what)?;
                self.last = self.text.at() - 1;
                Ok(value)
            }
            Some(order) => {
                let bytes = self.bytes_of(scalar.size(), what)?;
                binary::integer(scalar, order, bytes)
                    .ok_or_else(|| self.fault(format!("{what} is stored as a real number; an integer is expected")))
            }
        }
    }

    /// The next integer as a count, or another number that cannot be negative.
    pub(super) fn count(&mut self, scalar: Scalar, what: Arguments<'_>) -> Result<usize, Fault> {
        let value = self.integer(scalar, what)?;
        usize::try_from(value).map_err(|_| self.fault(format!("{what} is {value}; it cannot be negative")))
    }

    /// The next number, finite or not; `scalar` is its binary type.
    pub(super) fn real(&mut self, scalar: Scalar, what: Arguments<'_>) -> Result<f64, Fault> {
        match self.binary {
            None => {
                let value = self.text.real(what)?;
                self.last = self.text.at() - 1;
                Ok(value)
            }
            Some(order) => Ok(binary::real(scalar, order, self.bytes_of(scalar.size(), what)?)),
        }
    }

    /// The next number, which has to be finite.
    pub(super) fn finite(&mut self, scalar: Scalar, what: Arguments<'_>) -> Result<f64, Fault> {
        let value = self.real(scalar, what)?;
        if !value.is_finite() {
            return Err(self.fault(format!("{what} is {value}, not a finite number; give it a value")));
        }
        Ok(value)
    }

    /// The next integer as an index from 0 below `points`.
    pub(super) fn index(&mut self, scalar: Scalar, points: usize, what: Arguments<'_>) -> Result<u32, Fault> {
        let value = self.integer(scalar, what)?;
        match u32::try_from(value) {
            Ok(index) if (index as usize) < points => Ok(index),
            _ => Err(self.fault(format!("{what} is {value}; there are {points} points, counted from 0"))),
        }
    }
}
