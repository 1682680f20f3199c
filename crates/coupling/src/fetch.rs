//! Memory that is asked for before it is needed: points lie in elements all over the mesh, and one after the other they
//! would wait for each.

/// Points whose elements are asked for together.
pub(crate) const BLOCK: usize = 64;

/// Lets the cache line at `place` come near, where the processor can be asked to; nothing else changes.
#[inline(always)]
pub(crate) fn fetch<T>(place: &T) {
    #[cfg(target_arch = "x86_64")]
    safe_arch::prefetch_t0(place);
    #[cfg(not(target_arch = "x86_64"))]
    let _ = place;
}

/// The elements of a list, each once where it is there several times in a row.
pub(crate) fn runs(elements: impl Iterator<Item = u32>) -> impl Iterator<Item = u32> {
    let mut last = None;
    elements.filter(move |&element| last.replace(element) != Some(element))
}
