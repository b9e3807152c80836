//! Numbers in binary form.

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

/// The first `N` of `bytes`, the least significant first; zeros where there are fewer.
fn chunk<const N: usize>(bytes: &[u8], order: Order) -> [u8; N] {
    let mut chunk = bytes.first_chunk().copied().unwrap_or([0; N]);
    if order == Order::Big {
        chunk.reverse();
    }
    chunk
}

/// The number that `bytes` start with.
pub(super) fn real(scalar: Scalar, order: Order, bytes: &[u8]) -> f64 {
    match scalar {
        Scalar::Int8 => f64::from(i8::from_le_bytes(chunk(bytes, order))),
        Scalar::UInt8 => f64::from(u8::from_le_bytes(chunk(bytes, order))),
        Scalar::Int16 => f64::from(i16::from_le_bytes(chunk(bytes, order))),
        Scalar::UInt16 => f64::from(u16::from_le_bytes(chunk(bytes, order))),
        Scalar::Int32 => f64::from(i32::from_le_bytes(chunk(bytes, order))),
        Scalar::UInt32 => f64::from(u32::from_le_bytes(chunk(bytes, order))),
        Scalar::Int64 => i64::from_le_bytes(chunk(bytes, order)) as f64,
        Scalar::UInt64 => u64::from_le_bytes(chunk(bytes, order)) as f64,
        Scalar::Float32 => f64::from(f32::from_le_bytes(chunk(bytes, order))),
        Scalar::Float64 => f64::from_le_bytes(chunk(bytes, order)),
    }
}

/// The integer that `bytes` start with; `None` for the types of real numbers. An unsigned number beyond `i64` becomes -1,
/// which is no valid index or count.
pub(super) fn integer(scalar: Scalar, order: Order, bytes: &[u8]) -> Option<i64> {
    Some(match scalar {
        Scalar::Int8 => i64::from(i8::from_le_bytes(chunk(bytes, order))),
        Scalar::UInt8 => i64::from(u8::from_le_bytes(chunk(bytes, order))),
        Scalar::Int16 => i64::from(i16::from_le_bytes(chunk(bytes, order))),
        Scalar::UInt16 => i64::from(u16::from_le_bytes(chunk(bytes, order))),
        Scalar::Int32 => i64::from(i32::from_le_bytes(chunk(bytes, order))),
        Scalar::UInt32 => i64::from(u32::from_le_bytes(chunk(bytes, order))),
        Scalar::Int64 => i64::from_le_bytes(chunk(bytes, order)),
        Scalar::UInt64 => i64::try_from(u64::from_le_bytes(chunk(bytes, order))).unwrap_or(-1),
        Scalar::Float32 | Scalar::Float64 => return None,
    })
}

/// The numbers in `bytes`; bytes beyond the last whole number are ignored.
pub(super) fn reals(scalar: Scalar, order: Order, bytes: &[u8]) -> Vec<f64> {
    let chunks = bytes.chunks_exact(scalar.size());
    chunks.map(|bytes| real(scalar, order, bytes)).collect()
}

/// The integers in `bytes`, as [`integer`] reads each.
pub(super) fn integers(scalar: Scalar, order: Order, bytes: &[u8]) -> Option<Vec<i64>> {
    let chunks = bytes.chunks_exact(scalar.size());
    chunks.map(|bytes| integer(scalar, order, bytes)).collect()
}
