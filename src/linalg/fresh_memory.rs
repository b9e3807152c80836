//! Large arrays of zeros whose pages are there from the start.
//!
//! The system gives memory page by page when it is first touched, by an interrupt each: of a sparse factorization that
//! is a fifth of the time on a virtual machine. Asking for all pages at once costs a third of that. Advice only: where
//! the system does not know it, or has not so much memory, pages come one by one as ever.

/// Zeros that are going to be written, nearly all of them.
pub fn zeros(count: usize) -> Vec<f64> {
    // Fresh zeros come from the system without a pass over them, which a resize would make.
    let mut values = vec![0.0; count];
    populate(&mut values);
    values
}

#[cfg(target_os = "linux")]
fn populate(values: &mut [f64]) {
    use rustix::mm::{Advice, madvise};
    /// Bytes from which on the system is asked.
    const LARGE: usize = 4 << 20;
    /// A multiple of every size of a page.
    const PAGE: usize = 64 << 10;
    let bytes = std::mem::size_of_val(values);
    if bytes < LARGE {
        return;
    }
    let start = values.as_mut_ptr().cast::<u8>();
    let skipped = start.align_offset(PAGE);
    let length = (bytes - skipped) / PAGE * PAGE;
    // SAFETY: the range lies within `values`, which this function holds alone, and the advice keeps its content.
    let _ = unsafe { madvise(start.add(skipped).cast(), length, Advice::LinuxPopulateWrite) };
}

#[cfg(not(target_os = "linux"))]
fn populate(_values: &mut [f64]) {}
