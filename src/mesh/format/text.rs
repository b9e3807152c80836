//! Words and numbers of a text file, with the place of each for messages.

use super::Fault;
use std::fmt::Arguments;

/// The line, from 1, that holds the byte at offset `at`.
pub(super) fn line_of(bytes: &[u8], at: usize) -> usize {
    let before = &bytes[..at.min(bytes.len())];
    1 + before.iter().filter(|&&byte| byte == b'\n').count()
}

/// Whether `word` is `keyword`, in whatever case.
pub(super) fn same(word: &[u8], keyword: &str) -> bool {
    word.eq_ignore_ascii_case(keyword.as_bytes())
}

/// A word as it is shown in a message: short, quoted, control characters escaped.
pub(super) fn shown(word: &[u8]) -> String {
    let text = String::from_utf8_lossy(&word[..word.len().min(40)]);
    format!("{text:?}{}", if word.len() > 40 { "..." } else { "" })
}

/// The number that a word spells; Fortran's exponent letter `D` is understood.
pub(super) fn parse_real(word: &[u8]) -> Option<f64> {
    let text = std::str::from_utf8(word).ok()?;
    if let Ok(value) = text.parse() {
        return Some(value);
    }
    let exponent = text.find(['d', 'D'])?;
    let (mantissa, exponent) = (&text[..exponent], &text[exponent + 1..]);
    format!("{mantissa}e{exponent}").parse().ok()
}

/// The integer that a word spells.
pub(super) fn parse_integer(word: &[u8]) -> Option<i64> {
    let (negative, digits) = match word {
        [b'-', digits @ ..] => (true, digits),
        [b'+', digits @ ..] => (false, digits),
        digits => (false, digits),
    };
    if digits.is_empty() {
        return None;
    }
    let mut value: i64 = 0;
    for &digit in digits {
        if !digit.is_ascii_digit() {
            return None;
        }
        value = value.checked_mul(10)?.checked_add(i64::from(digit - b'0'))?;
    }
    Some(if negative { -value } else { value })
}

/// A text, read word by word or line by line.
pub(super) struct Text<'a> {
    bytes: &'a [u8],
    at: usize,
    end: usize,
    comment: Option<u8>,
}

impl<'a> Text<'a> {
    /// Reads `bytes` from the start; `comment` opens a comment that lasts to the end of the line.
    pub(super) fn new(bytes: &'a [u8], comment: Option<u8>) -> Text<'a> {
        let at = if bytes.starts_with(b"\xef\xbb\xbf") { 3 } else { 0 };
        Text {
            bytes,
            at,
            end: bytes.len(),
            comment,
        }
    }

    /// Reads only the part of `bytes` from `start` to `end`; places still count from the start of `bytes`.
    pub(super) fn part(bytes: &'a [u8], start: usize, end: usize, comment: Option<u8>) -> Text<'a> {
        let end = end.min(bytes.len());
        Text {
            bytes,
            at: start.min(end),
            end,
            comment,
        }
    }

    /// Where the next word or line starts, at the latest.
    pub(super) fn at(&self) -> usize {
        self.at
    }

    /// Goes on at the given offset.
    pub(super) fn go_to(&mut self, at: usize) {
        self.at = at.min(self.end);
    }

    /// How many bytes are left.
    pub(super) fn remaining(&self) -> usize {
        self.end - self.at
    }

    /// Passes blanks, ends of lines and comments.
    pub(super) fn skip_blank(&mut self) {
        while self.at < self.end {
            let byte = self.bytes[self.at];
            if byte.is_ascii_whitespace() {
                self.at += 1;
            } else if Some(byte) == self.comment {
                self.skip_line();
            } else {
                break;
            }
        }
    }

    fn skip_line(&mut self) {
        let rest = &self.bytes[self.at..self.end];
        self.at += rest
            .iter()
            .position(|&byte| byte == b'\n')
            .map_or(rest.len(), |end| end + 1);
    }

    /// The next word; its place is `self.at() - word.len()` afterwards.
    pub(super) fn word(&mut self) -> Option<&'a [u8]> {
        self.skip_blank();
        let start = self.at;
        while self.at < self.end {
            let byte = self.bytes[self.at];
            if byte.is_ascii_whitespace() || Some(byte) == self.comment {
                break;
            }
            self.at += 1;
        }
        (start < self.at).then(|| &self.bytes[start..self.at])
    }

    /// The next word without passing it, nor the blanks before it, which may belong to binary numbers.
    pub(super) fn peek(&mut self) -> Option<&'a [u8]> {
        let start = self.at;
        let word = self.word();
        self.at = start;
        word
    }

    /// The rest of the current line without its end, passing it; `None` at the end of the text.
    pub(super) fn line(&mut self) -> Option<&'a [u8]> {
        if self.at >= self.end {
            return None;
        }
        let start = self.at;
        self.skip_line();
        let mut line = &self.bytes[start..self.at];
        if let [rest @ .., b'\n'] = line {
            line = rest;
        }
        if let [rest @ .., b'\r'] = line {
            line = rest;
        }
        Some(line)
    }

    /// The error that the word just passed is not `what`.
    pub(super) fn not(&self, word: &[u8], what: Arguments<'_>) -> Fault {
        Fault::text(
            self.at - word.len(),
            format!("{} stands where {what} is expected", shown(word)),
        )
    }

    /// The error that the next word is not `what`.
    pub(super) fn next_is_not(&mut self, what: Arguments<'_>) -> Fault {
        match self.word() {
            Some(word) => self.not(word, what),
            None => self.ended(what),
        }
    }

    /// The error that the text ends where `what` is expected.
    pub(super) fn ended(&self, what: Arguments<'_>) -> Fault {
        Fault::text(
            self.end.saturating_sub(1),
            format!("the file ends where {what} is expected; it is cut off, or a count is too large"),
        )
    }

    /// The next word, which has to be there.
    pub(super) fn need(&mut self, what: Arguments<'_>) -> Result<&'a [u8], Fault> {
        self.word().ok_or_else(|| self.ended(what))
    }

    /// The next word as a number, finite or not.
    pub(super) fn real(&mut self, what: Arguments<'_>) -> Result<f64, Fault> {
        let word = self.need(what)?;
        parse_real(word).ok_or_else(|| self.not(word, what))
    }

    /// The next word as a finite number.
    pub(super) fn finite(&mut self, what: Arguments<'_>) -> Result<f64, Fault> {
        let word = self.need(what)?;
        let value = parse_real(word).ok_or_else(|| self.not(word, what))?;
        if !value.is_finite() {
            return Err(Fault::text(
                self.at - word.len(),
                format!("{what} is {}, not a finite number; give it a value", shown(word)),
            ));
        }
        Ok(value)
    }

    /// The next word as an integer.
    pub(super) fn integer(&mut self, what: Arguments<'_>) -> Result<i64, Fault> {
        let word = self.need(what)?;
        parse_integer(word).ok_or_else(|| self.not(word, what))
    }

    /// The next word as a number of things, each of which takes at least `least` bytes of the text that is left.
    pub(super) fn count(&mut self, what: Arguments<'_>, least: usize) -> Result<usize, Fault> {
        let value = self.integer(what)?;
        let start = self.at;
        let count = usize::try_from(value)
            .map_err(|_| Fault::text(start, format!("{what} is {value}; it cannot be negative")))?;
        // One byte less, since the last number needs no blank after it.
        if count.saturating_mul(least) > self.remaining() + 1 {
            return Err(Fault::text(
                start,
                format!(
                    "{what} is {count}, but only {} bytes follow; correct the count or restore the rest of the file",
                    self.remaining()
                ),
            ));
        }
        Ok(count)
    }
}
