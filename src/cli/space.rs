//! A full disk: what has been rendered is not thrown away for want of space; the night waits for it.

use std::time::Duration;

use crate::experiment::Control;
use crate::store::StoreError;

/// How long the night waits before it tries again.
pub const STEP: Duration = Duration::from_secs(2);

/// Tries until there is space, or the user ends the night. `wait` passes some time; what happens is said once, when the
/// disk is first found full, and once when it is no longer.
///
/// # Errors
/// Every error but that of a full disk, and that one when the user has ended the night.
pub fn patiently<T>(
    control: &Control,
    wait: &dyn Fn(),
    mut attempt: impl FnMut() -> Result<T, StoreError>,
) -> Result<T, StoreError> {
    let mut waited = false;
    loop {
        match attempt() {
            Err(error) if error.is_full() && !control.stop_requested() => {
                if !waited {
                    tracing::error!("the disk is full, and the night waits for space: {error}");
                    waited = true;
                }
                wait();
            }
            result => {
                if waited && result.is_ok() {
                    tracing::info!("there is space again; the night goes on");
                }
                return result;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use std::cell::Cell;

    use super::*;

    fn failing(full: bool) -> StoreError {
        StoreError::Io { action: "write", path: "x".into(), reason: "as told".to_owned(), full }
    }

    #[test]
    fn waits_for_space_and_for_nothing_else() {
        let control = Control::default();
        let waits = Cell::new(0);
        let wait = || waits.set(waits.get() + 1);
        let mut left = 3;
        let found = patiently(&control, &wait, || {
            left -= 1;
            if left > 0 { Err(failing(true)) } else { Ok(7) }
        });
        assert_eq!((found.unwrap(), waits.get()), (7, 2));
        assert!(patiently(&control, &wait, || Err::<(), _>(failing(false))).is_err());
        assert_eq!(waits.get(), 2, "another error is none that time heals");
    }

    #[test]
    fn the_user_ends_the_waiting() {
        let control = Control::default();
        let wait = || {
            control.request_stop();
        };
        let found = patiently(&control, &wait, || Err::<(), _>(failing(true)));
        assert!(found.unwrap_err().is_full());
    }
}
