//! Numbers in binary files.

use super::Fault;

/// A type of numbers in a file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Scalar {
    Int8,
    UInt8,
    Int16,
    UInt16,
    Int32,
    UInt32,
    Int64,
    UInt64,
    Float32,
    Float64,
}

impl Scalar {
    /// Bytes per number.
    pub(super) fn size(self) -> usize {
        match self {
            Scalar::Int8 | Scalar::UInt8 => 1,
            Scalar::Int16 | Scalar::UInt16 => 2,
            Scalar::Int32 | Scalar::UInt32 | Scalar::Float32 => 4,
            Scalar::Int64 | Scalar::UInt64 | Scalar::Float64 => 8,
        }
    }
}

/// The byte order of a file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Order {
    Little,
    Big,
}

fn converted<const N: usize, T>(bytes: &[u8], order: Order, from: impl Fn([u8; N]) -> T) -> Vec<T> {
    let (chunks, _) = bytes.as_chunks::<N>();
    match order {
        Order::Little => chunks.iter().map(|&chunk| from(chunk)).collect(),
        Order::Big => chunks
            .iter()
            .map(|&(mut chunk)| {
                chunk.reverse();
                from(chunk)
            })
            .collect(),
    }
}

/// The numbers in `bytes`; bytes beyond the last whole number are ignored.
pub(super) fn reals(scalar: Scalar, order: Order, bytes: &[u8]) -> Vec<f64> {
    match scalar {
        Scalar::Int8 => converted(bytes, order, |b| f64::from(i8::from_le_bytes(b))),
        Scalar::UInt8 => converted(bytes, order, |b| f64::from(u8::from_le_bytes(b))),
        Scalar::Int16 => converted(bytes, order, |b| f64::from(i16::from_le_bytes(b))),
        Scalar::UInt16 => converted(bytes, order, |b| f64::from(u16::from_le_bytes(b))),
        Scalar::Int32 => converted(bytes, order, |b| f64::from(i32::from_le_bytes(b))),
        Scalar::UInt32 => converted(bytes, order, |b| f64::from(u32::from_le_bytes(b))),
        Scalar::Int64 => converted(bytes, order, |b| i64::from_le_bytes(b) as f64),
        Scalar::UInt64 => converted(bytes, order, |b| u64::from_le_bytes(b) as f64),
        Scalar::Float32 => converted(bytes, order, |b| f64::from(f32::from_le_bytes(b))),
        Scalar::Float64 => converted(bytes, order, f64::from_le_bytes),
    }
}

/// The integers in `bytes`; `None` for the types of real numbers. Unsigned numbers beyond `i64` become -1, no valid index.
pub(super) fn integers(scalar: Scalar, order: Order, bytes: &[u8]) -> Option<Vec<i64>> {
    Some(match scalar {
        Scalar::Int8 => converted(bytes, order, |b| i64::from(i8::from_le_bytes(b))),
        Scalar::UInt8 => converted(bytes, order, |b| i64::from(u8::from_le_bytes(b))),
        Scalar::Int16 => converted(bytes, order, |b| i64::from(i16::from_le_bytes(b))),
        Scalar::UInt16 => converted(bytes, order, |b| i64::from(u16::from_le_bytes(b))),
        Scalar::Int32 => converted(bytes, order, |b| i64::from(i32::from_le_bytes(b))),
        Scalar::UInt32 => converted(bytes, order, |b| i64::from(u32::from_le_bytes(b))),
        Scalar::Int64 => converted(bytes, order, i64::from_le_bytes),
        Scalar::UInt64 => converted(bytes, order, |b| i64::try_from(u64::from_le_bytes(b)).unwrap_or(-1)),
        Scalar::Float32 | Scalar::Float64 => return None,
    })
}

/// The next `count` numbers of `size` bytes at `at`, and the offset behind them.
pub(super) fn take<'a>(
    bytes: &'a [u8],
    at: usize,
    count: usize,
    size: usize,
    what: std::fmt::Arguments<'_>,
) -> Result<(&'a [u8], usize), Fault> {
    let left = bytes.len().saturating_sub(at);
    match count.checked_mul(size) {
        Some(wanted) if wanted <= left => Ok((&bytes[at..at + wanted], at + wanted)),
        _ => Err(Fault::binary(
            at,
            format!("{what} needs {count} x {size} bytes, {left} are left; the file is cut off, or a count is damaged"),
        )),
    }
}
