//! Vectors of x86-64 processors: 8 lanes with AVX2 and FMA, 16 with AVX-512.
//!
//! The two types are private to `fast`, and the only ways to a kernel that uses them ask the processor first. Vertices are
//! 16 bytes: each is loaded whole, and four of them are transposed in registers.

use super::lanes::{Kernel, Lanes, Place, Row, WIDTH};
use core::arch::x86_64::*;
use core::ops::{Add, Div, Mul, Sub};

pub(super) fn has_avx2() -> bool {
    std::arch::is_x86_feature_detected!("avx2") && std::arch::is_x86_feature_detected!("fma")
}

pub(super) fn has_avx512() -> bool {
    has_avx2()
        && std::arch::is_x86_feature_detected!("avx512f")
        && std::arch::is_x86_feature_detected!("avx512dq")
        && std::arch::is_x86_feature_detected!("avx512vl")
}

/// Has the function that it is inlined into align its stack, and with it the vectors that do not fit into registers: the
/// compiler knows of these only when it is too late to, and half of them would lie across two lines of the cache.
#[inline(always)]
fn align_stack() {
    #[repr(align(64))]
    struct Aligned(#[expect(dead_code, reason = "it is there for its place")] u8);
    core::hint::black_box(&Aligned(0));
}

pub(super) fn with_avx2<K: Kernel>(kernel: K) -> K::Out {
    #[target_feature(enable = "avx2,fma")]
    fn inner<K: Kernel>(kernel: K) -> K::Out {
        align_stack();
        kernel.run::<Eight>()
    }
    assert!(has_avx2(), "asked before");
    // SAFETY: the processor has just said that it has these.
    unsafe { inner(kernel) }
}

/// Whether the processor's own gathers are quick: Intel's since Sapphire Rapids, which are the first with half precision.
/// Those before are slow since GDS (CVE-2022-40982) was mended, AMD's slower than loads one by one.
fn gathers_quickly() -> bool {
    std::arch::is_x86_feature_detected!("avx512fp16")
}

pub(super) fn with_avx512<K: Kernel>(kernel: K) -> K::Out {
    if gathers_quickly() { sixteen::<K, true>(kernel) } else { sixteen::<K, false>(kernel) }
}

/// Runs a kernel on sixteen lanes, with or without the processor's own gathers.
pub(super) fn sixteen<K: Kernel, const GATHERS: bool>(kernel: K) -> K::Out {
    #[target_feature(enable = "avx2,fma,avx512f,avx512dq,avx512vl")]
    fn inner<K: Kernel, const GATHERS: bool>(kernel: K) -> K::Out {
        align_stack();
        kernel.run::<Sixteen<GATHERS>>()
    }
    assert!(has_avx512(), "asked before");
    // SAFETY: the processor has just said that it has these.
    unsafe { inner::<K, GATHERS>(kernel) }
}

/// Eight lanes.
#[derive(Clone, Copy)]
struct Eight(__m256);

/// Sixteen lanes; whether numbers are fetched by the processor's own gathers.
#[derive(Clone, Copy)]
struct Sixteen<const GATHERS: bool>(__m512);

macro_rules! operator {
    ([$($generics:tt)*] $type:ty, $trait:ident $method:ident $op:ident) => {
        impl<$($generics)*> $trait for $type {
            type Output = Self;
            #[inline(always)]
            fn $method(self, other: Self) -> Self {
                // SAFETY: a value of this type exists only where the processor has its instructions.
                Self(unsafe { $op(self.0, other.0) })
            }
        }
    };
}
operator!([] Eight, Add add _mm256_add_ps);
operator!([] Eight, Sub sub _mm256_sub_ps);
operator!([] Eight, Mul mul _mm256_mul_ps);
operator!([] Eight, Div div _mm256_div_ps);
operator!([const GATHERS: bool] Sixteen<GATHERS>, Add add _mm512_add_ps);
operator!([const GATHERS: bool] Sixteen<GATHERS>, Sub sub _mm512_sub_ps);
operator!([const GATHERS: bool] Sixteen<GATHERS>, Mul mul _mm512_mul_ps);
operator!([const GATHERS: bool] Sixteen<GATHERS>, Div div _mm512_div_ps);

impl Lanes for Eight {
    const N: usize = 8;
    #[inline(always)]
    fn splat(v: f32) -> Self {
        // SAFETY: only kernels started by `with_avx2` use this type.
        Self(unsafe { _mm256_set1_ps(v) })
    }
    #[inline(always)]
    fn load(row: &Row, first: usize) -> Self {
        let lanes: &[f32; 8] = row[first..].first_chunk().expect("a multiple of eight below sixteen");
        // SAFETY: eight numbers are there.
        Self(unsafe { _mm256_loadu_ps(lanes.as_ptr()) })
    }
    #[inline(always)]
    fn store(self, row: &mut Row, first: usize) {
        let lanes: &mut [f32; 8] = row[first..].first_chunk_mut().expect("a multiple of eight below sixteen");
        // SAFETY: there is room for eight.
        unsafe { _mm256_storeu_ps(lanes.as_mut_ptr(), self.0) };
    }
    #[inline(always)]
    fn sqrt(self) -> Self {
        // SAFETY: as for the operators.
        Self(unsafe { _mm256_sqrt_ps(self.0) })
    }
    #[inline(always)]
    fn mul_add(self, factor: Self, more: Self) -> Self {
        // SAFETY: as for the operators.
        Self(unsafe { _mm256_fmadd_ps(self.0, factor.0, more.0) })
    }
    #[inline(always)]
    fn mul_off(self, factor: Self, from: Self) -> Self {
        // SAFETY: as for the operators.
        Self(unsafe { _mm256_fnmadd_ps(self.0, factor.0, from.0) })
    }
    #[inline(always)]
    fn max(self, other: Self) -> Self {
        // SAFETY: as for the operators.
        Self(unsafe { _mm256_max_ps(self.0, other.0) })
    }
    #[inline(always)]
    fn min(self, other: Self) -> Self {
        // SAFETY: as for the operators.
        Self(unsafe { _mm256_min_ps(self.0, other.0) })
    }
    #[inline(always)]
    fn or_zero(self) -> Self {
        // SAFETY: as for the operators. A number less itself is zero, anything else is not a number.
        unsafe {
            let none = _mm256_sub_ps(self.0, self.0);
            Self(_mm256_and_ps(self.0, _mm256_cmp_ps::<_CMP_EQ_OQ>(none, _mm256_setzero_ps())))
        }
    }
    #[inline(always)]
    fn if_negative(self, yes: Self, no: Self) -> Self {
        // SAFETY: as for the operators.
        unsafe {
            let negative = _mm256_cmp_ps::<_CMP_LT_OQ>(self.0, _mm256_setzero_ps());
            Self(_mm256_blendv_ps(no.0, yes.0, negative))
        }
    }
    #[inline(always)]
    fn choose(bits: u16, first: usize, yes: Self, no: Self) -> Self {
        // SAFETY: as for the operators. A lane is chosen where its own bit is left.
        unsafe {
            let own = if first == 0 {
                _mm256_setr_epi32(1, 2, 4, 8, 16, 32, 64, 128)
            } else {
                _mm256_setr_epi32(1 << 8, 1 << 9, 1 << 10, 1 << 11, 1 << 12, 1 << 13, 1 << 14, 1 << 15)
            };
            let left = _mm256_and_si256(_mm256_set1_epi16(bits.cast_signed()), own);
            Self(_mm256_blendv_ps(no.0, yes.0, _mm256_castsi256_ps(_mm256_cmpeq_epi32(left, own))))
        }
    }
    #[inline(always)]
    fn load_pairs(pairs: &[[f32; 2]; WIDTH], first: usize) -> [Self; 2] {
        let lanes: &[f32; 16] = pairs[first..].as_flattened().first_chunk().expect("eight pairs are there");
        // SAFETY: sixteen numbers are there.
        unsafe {
            let (a, b) = (_mm256_loadu_ps(lanes.as_ptr()), _mm256_loadu_ps(lanes.as_ptr().add(8)));
            // The outer halves change places, so that halves have four pairs side by side.
            let (low, high) = (_mm256_permute2f128_ps::<0x20>(a, b), _mm256_permute2f128_ps::<0x31>(a, b));
            [Self(_mm256_shuffle_ps::<0x88>(low, high)), Self(_mm256_shuffle_ps::<0xdd>(low, high))]
        }
    }
    #[inline(always)]
    unsafe fn gather_numbers<P: Place>(from: *const f32, places: &[P; WIDTH], l: usize) -> Self {
        // SAFETY: `Numbers` has checked all places against the count of its numbers.
        unsafe { Self(eight(from, places, l)) }
    }
    #[inline(always)]
    unsafe fn gather<P: Place>(from: *const [f32; 4], places: &[P; WIDTH], first: usize) -> [Self; 4] {
        // SAFETY: `Window` has checked all places against the length of its vertices.
        unsafe {
            let (l, h) = (first, first + 4);
            let [x, y, z, w] = transpose8([
                pair(from, places[l], places[h]),
                pair(from, places[l + 1], places[h + 1]),
                pair(from, places[l + 2], places[h + 2]),
                pair(from, places[l + 3], places[h + 3]),
            ]);
            [Self(x), Self(y), Self(z), Self(w)]
        }
    }
    #[inline(always)]
    unsafe fn scatter(v: [Self; 4], to: *mut [f32; 4], places: &[u16; WIDTH], first: usize, count: usize) {
        // SAFETY: as in `gather`, and the window holds its vertices alone.
        unsafe {
            let rows = transpose8([v[0].0, v[1].0, v[2].0, v[3].0]);
            if count >= 8 {
                put_two(to, places, first, rows[0]);
                put_two(to, places, first + 1, rows[1]);
                put_two(to, places, first + 2, rows[2]);
                put_two(to, places, first + 3, rows[3]);
                return;
            }
            let rows = [halves(rows[0]), halves(rows[1]), halves(rows[2]), halves(rows[3])];
            for l in 0..count {
                put(to, places[first + l], rows[l % 4][l / 4]);
            }
        }
    }
}

impl<const GATHERS: bool> Lanes for Sixteen<GATHERS> {
    const N: usize = 16;
    #[inline(always)]
    fn splat(v: f32) -> Self {
        // SAFETY: only kernels started by `with_avx512` use this type.
        Self(unsafe { _mm512_set1_ps(v) })
    }
    #[inline(always)]
    fn load(row: &Row, _: usize) -> Self {
        // SAFETY: sixteen numbers are there.
        Self(unsafe { _mm512_loadu_ps(row.as_ptr()) })
    }
    #[inline(always)]
    fn store(self, row: &mut Row, _: usize) {
        // SAFETY: there is room for sixteen.
        unsafe { _mm512_storeu_ps(row.as_mut_ptr(), self.0) };
    }
    #[inline(always)]
    fn sqrt(self) -> Self {
        // SAFETY: as for the operators.
        Self(unsafe { _mm512_sqrt_ps(self.0) })
    }
    #[inline(always)]
    fn mul_add(self, factor: Self, more: Self) -> Self {
        // SAFETY: as for the operators.
        Self(unsafe { _mm512_fmadd_ps(self.0, factor.0, more.0) })
    }
    #[inline(always)]
    fn mul_off(self, factor: Self, from: Self) -> Self {
        // SAFETY: as for the operators.
        Self(unsafe { _mm512_fnmadd_ps(self.0, factor.0, from.0) })
    }
    #[inline(always)]
    fn max(self, other: Self) -> Self {
        // SAFETY: as for the operators.
        Self(unsafe { _mm512_max_ps(self.0, other.0) })
    }
    #[inline(always)]
    fn min(self, other: Self) -> Self {
        // SAFETY: as for the operators.
        Self(unsafe { _mm512_min_ps(self.0, other.0) })
    }
    #[inline(always)]
    fn or_zero(self) -> Self {
        // SAFETY: as for the operators. A number less itself is zero, anything else is not a number.
        unsafe {
            let none = _mm512_sub_ps(self.0, self.0);
            let sound = _mm512_cmp_ps_mask::<_CMP_EQ_OQ>(none, _mm512_setzero_ps());
            Self(_mm512_maskz_mov_ps(sound, self.0))
        }
    }
    #[inline(always)]
    fn if_negative(self, yes: Self, no: Self) -> Self {
        // SAFETY: as for the operators.
        unsafe {
            let negative = _mm512_cmp_ps_mask::<_CMP_LT_OQ>(self.0, _mm512_setzero_ps());
            Self(_mm512_mask_blend_ps(negative, no.0, yes.0))
        }
    }
    #[inline(always)]
    fn choose(bits: u16, _: usize, yes: Self, no: Self) -> Self {
        // SAFETY: as for the operators.
        Self(unsafe { _mm512_mask_blend_ps(bits, no.0, yes.0) })
    }
    #[inline(always)]
    fn load_pairs(pairs: &[[f32; 2]; WIDTH], _: usize) -> [Self; 2] {
        let from = pairs.as_flattened().as_ptr();
        // SAFETY: 32 numbers are there.
        unsafe { apart(_mm512_loadu_ps(from), _mm512_loadu_ps(from.add(16))).map(Self) }
    }
    #[inline(always)]
    unsafe fn gather_numbers<P: Place>(from: *const f32, places: &[P; WIDTH], _: usize) -> Self {
        // SAFETY: `Numbers` has checked all places against the count of its numbers.
        unsafe {
            if GATHERS {
                return Self(_mm512_i32gather_ps::<4>(indices(places), from));
            }
            let (low, high) = (eight(from, places, 0), eight(from, places, 8));
            Self(_mm512_insertf32x8::<1>(_mm512_castps256_ps512(low), high))
        }
    }
    #[inline(always)]
    unsafe fn gather<P: Place>(from: *const [f32; 4], places: &[P; WIDTH], _: usize) -> [Self; 4] {
        // SAFETY: `Window` has checked all places against the length of its vertices.
        unsafe {
            let [x, y, z, w] = transpose16([
                four(from, places, 0),
                four(from, places, 1),
                four(from, places, 2),
                four(from, places, 3),
            ]);
            [Self(x), Self(y), Self(z), Self(w)]
        }
    }
    #[inline(always)]
    unsafe fn scatter(v: [Self; 4], to: *mut [f32; 4], places: &[u16; WIDTH], _: usize, count: usize) {
        // SAFETY: as in `gather`, and the window holds its vertices alone.
        unsafe {
            let rows = transpose16([v[0].0, v[1].0, v[2].0, v[3].0]);
            let [a, b, c, d] = rows;
            if count >= 16 {
                put_four(to, places, 0, a);
                put_four(to, places, 1, b);
                put_four(to, places, 2, c);
                put_four(to, places, 3, d);
                return;
            }
            let rows = [quarters(a), quarters(b), quarters(c), quarters(d)];
            for l in 0..count {
                put(to, places[l], rows[l % 4][l / 4]);
            }
        }
    }
}

/// The first and the second numbers of sixteen pairs.
#[inline(always)]
unsafe fn apart(a: __m512, b: __m512) -> [__m512; 2] {
    // SAFETY: called by kernels of `Sixteen` only.
    unsafe {
        let even = _mm512_setr_epi32(0, 2, 4, 6, 8, 10, 12, 14, 16, 18, 20, 22, 24, 26, 28, 30);
        let odd = _mm512_setr_epi32(1, 3, 5, 7, 9, 11, 13, 15, 17, 19, 21, 23, 25, 27, 29, 31);
        [_mm512_permutex2var_ps(a, even, b), _mm512_permutex2var_ps(a, odd, b)]
    }
}

/// Sixteen places as the processor's gathers want them.
#[inline(always)]
unsafe fn indices<P: Place>(places: &[P; WIDTH]) -> __m512i {
    let wide: [u32; WIDTH] = core::array::from_fn(|l| places[l].at() as u32);
    // SAFETY: sixteen numbers are there.
    unsafe { _mm512_loadu_si512(wide.as_ptr().cast()) }
}

#[inline(always)]
unsafe fn put(to: *mut [f32; 4], place: u16, v: __m128) {
    // SAFETY: `Window` has checked the place.
    unsafe { _mm_storeu_ps(to.add(place.into()).cast(), v) };
}

#[inline(always)]
unsafe fn halves(row: __m256) -> [__m128; 2] {
    // SAFETY: called by kernels of `Eight` only.
    unsafe { [_mm256_castps256_ps128(row), _mm256_extractf128_ps::<1>(row)] }
}

#[inline(always)]
unsafe fn quarters(row: __m512) -> [__m128; 4] {
    // SAFETY: called by kernels of `Sixteen` only.
    unsafe {
        [
            _mm512_castps512_ps128(row),
            _mm512_extractf32x4_ps::<1>(row),
            _mm512_extractf32x4_ps::<2>(row),
            _mm512_extractf32x4_ps::<3>(row),
        ]
    }
}

/// Writes every fourth of sixteen vertices.
#[inline(always)]
unsafe fn put_four(to: *mut [f32; 4], places: &[u16; WIDTH], l: usize, row: __m512) {
    // SAFETY: `Window` has checked the places.
    unsafe {
        let [a, b, c, d] = quarters(row);
        put(to, places[l], a);
        put(to, places[l + 4], b);
        put(to, places[l + 8], c);
        put(to, places[l + 12], d);
    }
}

/// Writes two of eight vertices that are four lanes apart.
#[inline(always)]
unsafe fn put_two(to: *mut [f32; 4], places: &[u16; WIDTH], l: usize, row: __m256) {
    // SAFETY: `Window` has checked the places.
    unsafe {
        let [a, b] = halves(row);
        put(to, places[l], a);
        put(to, places[l + 4], b);
    }
}

/// The numbers of eight lanes.
#[inline(always)]
unsafe fn eight<P: Place>(from: *const f32, places: &[P; WIDTH], l: usize) -> __m256 {
    // SAFETY: `Numbers` has checked the places.
    unsafe {
        _mm256_setr_ps(
            *from.add(places[l].at()),
            *from.add(places[l + 1].at()),
            *from.add(places[l + 2].at()),
            *from.add(places[l + 3].at()),
            *from.add(places[l + 4].at()),
            *from.add(places[l + 5].at()),
            *from.add(places[l + 6].at()),
            *from.add(places[l + 7].at()),
        )
    }
}

/// Two vertices side by side.
#[inline(always)]
unsafe fn pair<P: Place>(from: *const [f32; 4], low: P, high: P) -> __m256 {
    // SAFETY: `Window` has checked the places.
    unsafe {
        let (low, high) = (_mm_loadu_ps(from.add(low.at()).cast()), _mm_loadu_ps(from.add(high.at()).cast()));
        _mm256_insertf128_ps::<1>(_mm256_castps128_ps256(low), high)
    }
}

/// Every fourth of sixteen vertices.
#[inline(always)]
unsafe fn four<P: Place>(from: *const [f32; 4], places: &[P; WIDTH], l: usize) -> __m512 {
    // SAFETY: `Window` has checked the places.
    unsafe {
        let (low, high) = (pair(from, places[l], places[l + 4]), pair(from, places[l + 8], places[l + 12]));
        _mm512_insertf32x8::<1>(_mm512_castps256_ps512(low), high)
    }
}

/// Transposes the 4x4 blocks of each half; the way there is the way back.
#[inline(always)]
unsafe fn transpose8([a, b, c, d]: [__m256; 4]) -> [__m256; 4] {
    // SAFETY: called by kernels of `Eight` only.
    unsafe {
        let (ab, cd) = (_mm256_unpacklo_ps(a, b), _mm256_unpacklo_ps(c, d));
        let (ba, dc) = (_mm256_unpackhi_ps(a, b), _mm256_unpackhi_ps(c, d));
        [
            _mm256_shuffle_ps::<0x44>(ab, cd),
            _mm256_shuffle_ps::<0xee>(ab, cd),
            _mm256_shuffle_ps::<0x44>(ba, dc),
            _mm256_shuffle_ps::<0xee>(ba, dc),
        ]
    }
}

/// Transposes the 4x4 blocks of each quarter.
#[inline(always)]
unsafe fn transpose16([a, b, c, d]: [__m512; 4]) -> [__m512; 4] {
    // SAFETY: called by kernels of `Sixteen` only.
    unsafe {
        let (ab, cd) = (_mm512_unpacklo_ps(a, b), _mm512_unpacklo_ps(c, d));
        let (ba, dc) = (_mm512_unpackhi_ps(a, b), _mm512_unpackhi_ps(c, d));
        [
            _mm512_shuffle_ps::<0x44>(ab, cd),
            _mm512_shuffle_ps::<0xee>(ab, cd),
            _mm512_shuffle_ps::<0x44>(ba, dc),
            _mm512_shuffle_ps::<0xee>(ba, dc),
        ]
    }
}
