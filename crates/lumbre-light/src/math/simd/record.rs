//! Named records: structs with a number per lane, whose lanes are stored as records in memory.
//!
//! [`record!`](crate::record) declares a struct generic over the number type, and the type of its
//! record. A record is an array of rows of eight numbers, so that vectors load and store it by
//! transposition.

/// Declares a struct of numbers in lanes and the record in which one lane is stored. The types of
/// fields are `Real`, `Word` and `Vec3`.
///
/// ```
/// use lumbre_light::record;
///
/// record! {
///     /// A ball in each lane.
///     pub struct Ball => BallRecord {
///         /// Position of the centre.
///         center: Vec3,
///         /// Distance from the centre to the surface.
///         radius: Real,
///     }
/// }
/// let ball: Ball<f32> = Ball { center: glam::Vec3::ONE, radius: 2.0 };
/// let [record] = BallRecord::store::<f32, 1>(ball);
/// assert_eq!(BallRecord::load::<f32, 1>([&record]).radius, 2.0);
/// ```
#[macro_export]
macro_rules! record {
    (
        $(#[$meta:meta])*
        $vis:vis struct $name:ident => $record:ident {
            $($(#[$field_meta:meta])* $field:ident: $kind:ident),* $(,)?
        }
    ) => {
        $(#[$meta])*
        $vis struct $name<R: $crate::math::real::Real> {
            $($(#[$field_meta])* pub $field: $crate::record!(@type R $kind),)*
        }

        impl<R: $crate::math::real::Real> Clone for $name<R> {
            #[inline(always)]
            fn clone(&self) -> $name<R> {
                *self
            }
        }

        impl<R: $crate::math::real::Real> Copy for $name<R> {}

        #[doc = concat!("One lane of [`", stringify!($name), "`] in memory.")]
        #[derive(Clone, Copy, Debug, Default)]
        #[repr(C, align(32))]
        $vis struct $record {
            rows: [$crate::math::simd::F32x8; $record::ROWS],
        }

        impl $record {
            /// Number of rows of eight numbers.
            const ROWS: usize = (0_usize $(+ $crate::record!(@columns $kind))*).div_ceil(8);

            /// Loads a record in each lane.
            #[inline(always)]
            $vis fn load<R: $crate::math::simd::Lanes<N>, const N: usize>(
                records: [&$record; N],
            ) -> $name<R> {
                let mut columns = [[R::splat(0.0); 8]; $record::ROWS];
                for (k, columns) in columns.iter_mut().enumerate() {
                    *columns = R::transpose_load($crate::math::simd::map_array(
                        records,
                        |record| &record.rows[k],
                    ));
                }
                let mut next = 0;
                let mut take = || {
                    let column = columns[next / 8][next % 8];
                    next += 1;
                    column
                };
                $name { $($field: $crate::record!(@load R take $kind)),* }
            }

            /// Stores each lane in a record.
            #[inline(always)]
            $vis fn store<R: $crate::math::simd::Lanes<N>, const N: usize>(
                lanes: $name<R>,
            ) -> [$record; N] {
                let mut columns = [[R::splat(0.0); 8]; $record::ROWS];
                let mut next = 0;
                let mut put = |column: R| {
                    columns[next / 8][next % 8] = column;
                    next += 1;
                };
                $($crate::record!(@store put $kind lanes.$field);)*
                let mut records = [$record::default(); N];
                for (k, columns) in columns.into_iter().enumerate() {
                    let rows = R::transpose_store(columns);
                    for (record, row) in records.iter_mut().zip(rows) {
                        record.rows[k] = row;
                    }
                }
                records
            }
        }
    };
    (@type $R:ident Real) => { $R };
    (@type $R:ident Word) => { <$R as $crate::math::real::Real>::Word };
    (@type $R:ident Vec3) => { <$R as $crate::math::real::Real>::Vec3 };
    (@columns Real) => { 1 };
    (@columns Word) => { 1 };
    (@columns Vec3) => { 3 };
    (@load $R:ident $take:ident Real) => { $take() };
    (@load $R:ident $take:ident Word) => { $crate::math::real::Real::bits($take()) };
    (@load $R:ident $take:ident Vec3) => {{
        let (x, y, z) = ($take(), $take(), $take());
        <<$R as $crate::math::real::Real>::Vec3 as $crate::math::real::Vector>::new(x, y, z)
    }};
    (@store $put:ident Real $value:expr) => { $put($value) };
    (@store $put:ident Word $value:expr) => {
        $put($crate::math::real::Word::bits_to_float($value))
    };
    (@store $put:ident Vec3 $value:expr) => {{
        let v = $value;
        $put($crate::math::real::Vector::x(v));
        $put($crate::math::real::Vector::y(v));
        $put($crate::math::real::Vector::z(v));
    }};
}
