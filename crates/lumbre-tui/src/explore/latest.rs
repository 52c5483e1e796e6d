//! A thread that answers the newest question.

use std::io;
use std::sync::{Arc, Condvar, Mutex, PoisonError};
use std::thread::JoinHandle;

use super::session::lock;

struct Mail<Q, A> {
    question: Option<Q>,
    answer: Option<A>,
    closed: bool,
}

/// A thread that computes the answer to the newest question. Older questions that wait are dropped.
/// It ends when this is dropped, after the answer in progress.
pub struct Latest<Q, A> {
    shared: Arc<(Mutex<Mail<Q, A>>, Condvar)>,
    thread: Option<JoinHandle<()>>,
}

impl<Q: Send + 'static, A: Send + 'static> Latest<Q, A> {
    /// Starts the thread.
    ///
    /// # Errors
    /// If the thread cannot be started.
    pub fn start(name: &str, answer: impl Fn(Q) -> A + Send + 'static) -> io::Result<Latest<Q, A>> {
        let mail = Mail {
            question: None,
            answer: None,
            closed: false,
        };
        let shared = Arc::new((Mutex::new(mail), Condvar::new()));
        let own = Arc::clone(&shared);
        let thread = std::thread::Builder::new()
            .name(name.to_owned())
            .spawn(move || {
                while let Some(question) = next(&own) {
                    let found = answer(question);
                    lock(&own.0).answer = Some(found);
                }
            })?;
        Ok(Latest {
            shared,
            thread: Some(thread),
        })
    }

    /// Asks a question.
    pub fn ask(&self, question: Q) {
        lock(&self.shared.0).question = Some(question);
        self.shared.1.notify_all();
    }

    /// Returns the newest answer, once.
    pub fn take(&self) -> Option<A> {
        lock(&self.shared.0).answer.take()
    }
}

/// Waits for a question; `None` if the thread is to end.
fn next<Q, A>(shared: &(Mutex<Mail<Q, A>>, Condvar)) -> Option<Q> {
    let mut mail = lock(&shared.0);
    loop {
        if mail.closed {
            return None;
        }
        if let Some(question) = mail.question.take() {
            return Some(question);
        }
        mail = shared.1.wait(mail).unwrap_or_else(PoisonError::into_inner);
    }
}

impl<Q, A> Drop for Latest<Q, A> {
    fn drop(&mut self) {
        lock(&self.shared.0).closed = true;
        self.shared.1.notify_all();
        if let Some(thread) = self.thread.take() {
            // The panic hook has reported a panic of the thread.
            let _ = thread.join();
        }
    }
}

#[cfg(test)]
mod tests {
    use std::time::{Duration, Instant};

    use super::*;

    #[test]
    fn the_newest_question_is_answered_and_the_thread_ends() {
        let latest = Latest::start("double", |x: u64| {
            std::thread::sleep(Duration::from_millis(5));
            2 * x
        });
        let latest = latest.unwrap();
        for x in 0..100 {
            latest.ask(x);
        }
        let start = Instant::now();
        while latest.take() != Some(198) {
            assert!(start.elapsed() < Duration::from_secs(60));
            std::thread::sleep(Duration::from_millis(1));
        }
        drop(latest);
    }
}
