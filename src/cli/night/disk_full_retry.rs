//! Retry of writes on a full disk. The night waits for space instead of losing rendered results.

use std::time::Duration;

use lumbre_night::experiment::NightControls;
use lumbre_night::store::StoreError;

/// Time between two attempts to write.
pub const RETRY_INTERVAL: Duration = Duration::from_secs(2);

/// Sleeps for one [`RETRY_INTERVAL`].
pub fn sleep_before_retry() {
    std::thread::sleep(RETRY_INTERVAL);
}

/// Repeats `attempt` as long as it fails because the disk is full, until the user stops the night.
/// `wait` is called between attempts. Logs once when the disk is found full, and once when writing
/// succeeds again.
///
/// # Errors
/// Returns every other error at once, and the error of the full disk if the user has stopped the
/// night.
pub fn retry_while_disk_full<T>(
    control: &NightControls,
    wait: &dyn Fn(),
    mut attempt: impl FnMut() -> Result<T, StoreError>,
) -> Result<T, StoreError> {
    let mut waited = false;
    loop {
        match attempt() {
            Err(error) if error.is_full() && !control.stop_requested() => {
                if !waited {
                    tracing::error!("the disk is full; the night waits for free space: {error}");
                    waited = true;
                }
                wait();
            }
            result => {
                if waited && result.is_ok() {
                    tracing::info!("there is space again; the night continues");
                }
                return result;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use std::cell::Cell;
    use std::sync::{Arc, Mutex};

    use tracing::{Event, Level, Subscriber};
    use tracing_subscriber::Layer;
    use tracing_subscriber::layer::{Context, SubscriberExt};

    use crate::cli::night::disk_full_retry::*;

    fn failing(full: bool) -> StoreError {
        StoreError::Io {
            action: "write",
            path: "x".into(),
            reason: "simulated".to_owned(),
            full,
        }
    }

    #[test]
    fn waits_for_space_and_for_nothing_else() {
        let control = NightControls::default();
        let waits = Cell::new(0);
        let wait = || waits.set(waits.get() + 1);
        let mut left = 3;
        let found = retry_while_disk_full(&control, &wait, || {
            left -= 1;
            if left > 0 { Err(failing(true)) } else { Ok(7) }
        });
        assert_eq!((found.unwrap(), waits.get()), (7, 2));
        assert!(retry_while_disk_full(&control, &wait, || Err::<(), _>(failing(false))).is_err());
        assert_eq!(waits.get(), 2, "other errors are not retried");
    }

    /// Counts the records of each level.
    #[derive(Clone, Default)]
    struct Counter(Arc<Mutex<Vec<Level>>>);

    impl<S: Subscriber> Layer<S> for Counter {
        fn on_event(&self, event: &Event<'_>, _: Context<'_, S>) {
            self.0.lock().unwrap().push(*event.metadata().level());
        }
    }

    #[test]
    fn a_full_disk_is_reported_once_and_space_once() {
        let counter = Counter::default();
        let subscriber = tracing_subscriber::registry().with(counter.clone());
        let mut left = 5;
        tracing::subscriber::with_default(subscriber, || {
            let attempt = || {
                left -= 1;
                if left > 0 { Err(failing(true)) } else { Ok(()) }
            };
            retry_while_disk_full(&NightControls::default(), &|| {}, attempt).unwrap();
        });
        assert_eq!(*counter.0.lock().unwrap(), [Level::ERROR, Level::INFO]);
    }

    #[test]
    fn a_stop_request_ends_the_retries() {
        let control = NightControls::default();
        let wait = || {
            control.request_stop();
        };
        let found = retry_while_disk_full(&control, &wait, || Err::<(), _>(failing(true)));
        assert!(found.unwrap_err().is_full());
    }
}
