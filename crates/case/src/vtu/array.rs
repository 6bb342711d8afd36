//! One named array and its storage types.

/// Storage type of an array in the file.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Kind {
    /// `Float32`
    Float32,
    /// `Float64`
    Float64,
    /// `Int8`
    Int8,
    /// `UInt8`
    UInt8,
    /// `Int16`
    Int16,
    /// `UInt16`
    UInt16,
    /// `Int32`
    Int32,
    /// `UInt32`
    UInt32,
    /// `Int64`
    Int64,
    /// `UInt64`
    UInt64,
}

macro_rules! kinds {
    ($($kind:ident $name:literal $type:ty;)*) => {
        impl Kind {
            pub(super) fn parse(name: &str) -> Option<Self> {
                match name { $($name => Some(Self::$kind),)* _ => None }
            }

            pub(super) const fn name(self) -> &'static str {
                match self { $(Self::$kind => $name,)* }
            }

            pub(super) const fn size(self) -> usize {
                match self { $(Self::$kind => size_of::<$type>(),)* }
            }

            /// Little-endian bytes of one value, appended.
            #[allow(trivial_numeric_casts, reason = "the f64 arm of the macro casts f64 to itself")]
            pub(super) fn push(self, value: f64, out: &mut Vec<u8>) {
                match self { $(Self::$kind => out.extend_from_slice(&(value as $type).to_le_bytes()),)* }
            }

            /// Value of `size()` bytes, least significant first. 64-bit integers above 2^53 lose their last bits.
            #[allow(trivial_numeric_casts, reason = "the f64 arm of the macro casts f64 to itself")]
            pub(super) fn value(self, bytes: &[u8]) -> f64 {
                match self { $(Self::$kind => {
                    let mut raw = [0u8; size_of::<$type>()];
                    raw.copy_from_slice(bytes);
                    <$type>::from_le_bytes(raw) as f64
                })* }
            }
        }
    };
}

kinds! {
    Float32 "Float32" f32;
    Float64 "Float64" f64;
    Int8 "Int8" i8;
    UInt8 "UInt8" u8;
    Int16 "Int16" i16;
    UInt16 "UInt16" u16;
    Int32 "Int32" i32;
    UInt32 "UInt32" u32;
    Int64 "Int64" i64;
    UInt64 "UInt64" u64;
}

/// A named array of `components` numbers per point or cell.
#[derive(Debug, Clone, PartialEq)]
pub struct DataArray {
    /// Its name in the file.
    pub name: String,
    /// How it is stored.
    pub kind: Kind,
    /// Numbers per point or cell.
    pub components: usize,
    /// All numbers, point by point.
    pub values: Vec<f64>,
}

impl DataArray {
    /// One number per point or cell.
    pub fn scalars(name: &str, kind: Kind, values: Vec<f64>) -> Self {
        Self { name: name.to_owned(), kind, components: 1, values }
    }

    /// Three numbers per point or cell.
    pub fn vectors(name: &str, kind: Kind, values: &[[f64; 3]]) -> Self {
        Self { name: name.to_owned(), kind, components: 3, values: values.as_flattened().to_vec() }
    }
}
