//! Enums whose values have names in scripts and files.

/// Declares an enum of which each value has a name, with `ALL`, `NAMES`, `name` and `from_name`.
///
/// ```
/// lumbre_light::named! {
///     /// Side of a surface.
///     #[derive(Clone, Copy, Debug, PartialEq)]
///     pub enum Side {
///         /// The one its normal is on.
///         Front = "front",
///         /// The other one.
///         Back = "back",
///     }
/// }
/// assert_eq!(Side::from_name("back"), Some(Side::Back));
/// assert_eq!(Side::NAMES, ["front", "back"]);
/// ```
#[macro_export]
macro_rules! named {
    ($(#[$meta:meta])* $visible:vis enum $Enum:ident {
        $($(#[$of_value:meta])* $Value:ident = $name:literal,)+
    }) => {
        $(#[$meta])*
        $visible enum $Enum {
            $($(#[$of_value])* $Value,)+
        }

        impl $Enum {
            /// Names of the values in scripts and files.
            pub const NAMES: &'static [&'static str] = &[$($name),+];

            /// Every value, in the order of the names.
            pub const ALL: [$Enum; Self::NAMES.len()] = [$($Enum::$Value),+];

            /// Returns the name of the value.
            pub fn name(self) -> &'static str {
                Self::NAMES[self as usize]
            }

            /// Returns the value with this name.
            pub fn from_name(name: &str) -> Option<$Enum> {
                Self::ALL.into_iter().find(|value| value.name() == name)
            }
        }
    };
}
