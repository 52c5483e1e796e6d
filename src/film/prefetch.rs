//! Memory that is fetched before it is needed.

/// Asks for what will be needed soon: for the lines of the cache in which it begins and ends.
#[inline]
#[cfg_attr(target_arch = "x86_64", expect(unsafe_code, reason = "a hint to the processor that takes an address"))]
pub fn prefetch<T>(value: &T) {
    #[cfg(target_arch = "x86_64")]
    {
        use std::arch::x86_64::{_MM_HINT_T0, _mm_prefetch};
        let start = std::ptr::from_ref(value).cast::<i8>();
        // SAFETY: both addresses lie in what is borrowed, and nothing is read.
        unsafe {
            _mm_prefetch::<_MM_HINT_T0>(start);
            _mm_prefetch::<_MM_HINT_T0>(start.add(size_of::<T>().max(1) - 1));
        }
    }
    #[cfg(not(target_arch = "x86_64"))]
    let _ = value;
}
