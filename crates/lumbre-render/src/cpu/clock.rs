//! Render time of the CPU backend: wall time without what other work took from its threads.
//!
//! Two things lengthen a wave without being part of it. Other work on the machine makes threads
//! wait for a processor; the kernel counts how long (`/proc/thread-self/schedstat`: time on a
//! processor, time waited for one). And the process may be stopped (SIGSTOP, Ctrl-Z, a virtual
//! machine without a processor), which no counter of it shows: a thread that wakes fifty times a
//! second sees the gap. On systems without these counters nothing is taken off for waiting.

use std::sync::{Mutex, OnceLock, PoisonError};
use std::thread;
use std::time::{Duration, Instant};

use rayon::ThreadPool;

/// Share of the processor time that threads wanted and did not get up to which a wave counts as
/// undisturbed. On an idle machine it is a few thousandths.
const UNDISTURBED: f64 = 0.02;

/// Interval at which the watching thread looks at the clock.
const BEAT: Duration = Duration::from_millis(20);

/// Time beyond [`BEAT`] and its own waiting for a processor after which the watching thread
/// concludes that the process was stopped.
const STOPPED: Duration = Duration::from_millis(25);

/// Number of intervals that a wave waits at its end for a watching thread that has not woken.
const PATIENCE: u32 = 10;

/// Times of a wave in seconds.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct WaveTime {
    /// Render time: wall time without what was lost.
    pub render_s: f64,
    /// Time that other work on the machine took, or during which the process was stopped.
    pub lost_s: f64,
}

/// Clock of the waves that a pool of threads renders.
#[derive(Debug)]
pub struct RenderClock {
    /// Counters of the threads; empty where the system has none.
    #[cfg(target_os = "linux")]
    threads: Vec<std::fs::File>,
    /// Share of the wanted processor time that the threads get on a machine without other work:
    /// below 1 if there are more threads than processors.
    own_share: f64,
}

/// Processor time of some threads: on a processor, and waiting for one.
#[derive(Clone, Copy, Debug, Default)]
struct Processor {
    ran: Duration,
    waited: Duration,
}

/// Beginning of a wave.
#[derive(Clone, Copy, Debug)]
pub struct WaveStart {
    wall: Instant,
    stopped: Duration,
    processor: Option<Processor>,
}

impl RenderClock {
    /// Creates the clock of a pool.
    pub fn new(pool: &ThreadPool) -> RenderClock {
        let processors = thread::available_parallelism().map_or(1, usize::from) as f64;
        let threads = pool.current_num_threads() as f64;
        RenderClock {
            #[cfg(target_os = "linux")]
            threads: pool
                .broadcast(|_| std::fs::File::open("/proc/thread-self/schedstat"))
                .into_iter()
                .collect::<Result<_, _>>()
                .unwrap_or_default(),
            own_share: (processors / threads).min(1.0),
        }
    }

    /// Returns whether the system tells how long threads waited for a processor.
    pub fn watches_processor(&self) -> bool {
        self.processor().is_some_and(|p| p.ran > Duration::ZERO)
    }

    /// Begins a wave.
    pub fn start(&self) -> WaveStart {
        WaveStart {
            processor: self.processor(),
            stopped: stopped(),
            wall: Instant::now(),
        }
    }

    /// Ends a wave.
    pub fn stop(&self, start: &WaveStart) -> WaveTime {
        let wall_s = start.wall.elapsed().as_secs_f64();
        let stopped_s = (stopped().saturating_sub(start.stopped)).as_secs_f64();
        let processor = match (start.processor, self.processor()) {
            (Some(before), Some(after)) => after.since(before),
            _ => Processor::default(),
        };
        wave_time(wall_s, stopped_s, processor, self.own_share)
    }

    /// Returns the processor time of the threads so far.
    #[cfg(target_os = "linux")]
    fn processor(&self) -> Option<Processor> {
        use std::os::unix::fs::FileExt;

        let times = self.threads.iter().map(|file| {
            let mut text = [0; 96];
            let length = file.read_at(&mut text, 0).ok()?;
            parse_schedstat(std::str::from_utf8(&text[..length]).ok()?)
        });
        times.reduce(|a, b| Some(a?.and(b?))).flatten()
    }

    /// Returns `None`: this system does not tell.
    #[cfg(not(target_os = "linux"))]
    fn processor(&self) -> Option<Processor> {
        None
    }
}

impl Processor {
    #[cfg(target_os = "linux")]
    fn and(self, other: Processor) -> Processor {
        Processor {
            ran: self.ran + other.ran,
            waited: self.waited + other.waited,
        }
    }

    fn since(self, before: Processor) -> Processor {
        Processor {
            ran: self.ran.saturating_sub(before.ran),
            waited: self.waited.saturating_sub(before.waited),
        }
    }
}

/// Returns the times of a wave. Work is distributed over threads as they become free, so a wave
/// whose threads got half of the processor time that they wanted would have taken half of its time
/// alone.
fn wave_time(wall_s: f64, stopped_s: f64, processor: Processor, own_share: f64) -> WaveTime {
    let running_s = (wall_s - stopped_s).max(0.0);
    let [ran, waited] = [processor.ran, processor.waited].map(|time| time.as_secs_f64());
    let share = (ran / (ran + waited)) / own_share;
    // NaN if no thread has run.
    let render_s = if 1.0 - share > UNDISTURBED {
        running_s * share
    } else {
        running_s
    };
    WaveTime {
        render_s,
        lost_s: wall_s - render_s,
    }
}

/// Parses the first two numbers of a `schedstat` file: nanoseconds on a processor, and waiting for
/// one.
#[cfg(target_os = "linux")]
fn parse_schedstat(text: &str) -> Option<Processor> {
    let mut numbers = text.split_whitespace().map(|word| word.parse().ok());
    let mut next = || numbers.next().flatten().map(Duration::from_nanos);
    Some(Processor {
        ran: next()?,
        waited: next()?,
    })
}

/// State of the watching thread: when it last looked at the clock, and for how long the process has
/// been stopped since it started.
struct Watch {
    last: Instant,
    stopped: Duration,
}

static WATCH: OnceLock<Mutex<Watch>> = OnceLock::new();

/// Returns for how long this process has been stopped since the first call, which starts the
/// watching thread.
fn stopped() -> Duration {
    let watch = WATCH.get_or_init(|| {
        let watching = thread::Builder::new().name("stop-watch".to_owned());
        // Without the thread nothing is noticed, as on a system that cannot be watched.
        let _ = watching.spawn(|| {
            let clock = RenderClock::of_this_thread();
            loop {
                let before = clock.processor().unwrap_or_default();
                thread::sleep(BEAT);
                let waited = clock.processor().unwrap_or_default().since(before).waited;
                look(waited);
            }
        });
        Mutex::new(Watch {
            last: Instant::now(),
            stopped: Duration::ZERO,
        })
    });
    let read = || {
        let watch = watch.lock().unwrap_or_else(PoisonError::into_inner);
        (watch.last.elapsed() < BEAT + STOPPED, watch.stopped)
    };
    // After a stop the watching thread may wake later than the thread that ends the wave.
    for _ in 0..PATIENCE {
        let (is_watching, stopped) = read();
        if is_watching {
            return stopped;
        }
        thread::sleep(BEAT);
    }
    read().1
}

/// Counts the gap since the last look at the clock as stopped, unless the watching thread `waited`
/// for a processor for as long.
fn look(waited: Duration) {
    let Some(watch) = WATCH.get() else {
        return;
    };
    let mut watch = watch.lock().unwrap_or_else(PoisonError::into_inner);
    watch.look(Instant::now(), waited);
}

impl Watch {
    /// Counts the gap until `now` as stopped, less an interval and the time that the watching thread
    /// `waited` for a processor.
    fn look(&mut self, now: Instant, waited: Duration) {
        let since_last = now.saturating_duration_since(self.last);
        let gap = since_last.saturating_sub(BEAT + waited);
        if gap > STOPPED {
            self.stopped += gap;
        }
        self.last = now;
    }
}

impl RenderClock {
    /// Returns a clock of the calling thread alone.
    fn of_this_thread() -> RenderClock {
        RenderClock {
            #[cfg(target_os = "linux")]
            threads: std::fs::File::open("/proc/thread-self/schedstat")
                .into_iter()
                .collect(),
            own_share: 1.0,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn processor(ran_s: f64, waited_s: f64) -> Processor {
        Processor {
            ran: Duration::from_secs_f64(ran_s),
            waited: Duration::from_secs_f64(waited_s),
        }
    }

    #[test]
    fn waiting_and_stops_are_taken_off_the_wall_time() {
        let time = |wall, stopped, p, own| {
            let time = wave_time(wall, stopped, p, own);
            assert!((time.render_s + time.lost_s - wall).abs() < 1e-12);
            time.render_s
        };
        assert_eq!(
            time(2.0, 0.0, processor(4.0, 0.02), 1.0),
            2.0,
            "undisturbed"
        );
        assert_eq!(time(2.0, 0.0, processor(2.0, 2.0), 1.0), 1.0);
        assert_eq!(time(22.0, 20.0, processor(4.0, 0.0), 1.0), 2.0, "stopped");
        assert_eq!(
            time(4.0, 0.0, processor(4.0, 12.0), 0.25),
            4.0,
            "eight threads on two processors wait for one another"
        );
        assert_eq!(time(4.0, 0.0, processor(2.0, 14.0), 0.25), 2.0);
        assert_eq!(
            time(3.0, 0.0, Processor::default(), 1.0),
            3.0,
            "not watched"
        );
        // One thread was idle for half of the time, which is not waiting.
        assert_eq!(time(2.0, 0.0, processor(3.0, 0.0), 1.0), 2.0);
    }

    #[test]
    #[cfg(target_os = "linux")]
    fn counters_of_threads_are_read() {
        let read = parse_schedstat("1500000000 250000000 3\n").unwrap();
        assert_eq!(
            [read.ran, read.waited],
            [1500, 250].map(Duration::from_millis)
        );
        assert!(parse_schedstat("").is_none());
        let pool = rayon::ThreadPoolBuilder::new().num_threads(3).build();
        let pool = pool.unwrap();
        let clock = RenderClock::new(&pool);
        assert_eq!(clock.threads.len(), 3);
        let start = clock.start();
        let busy = || {
            let begun = Instant::now();
            while begun.elapsed() < Duration::from_millis(30) {
                std::hint::spin_loop();
            }
        };
        pool.broadcast(|_| busy());
        let processor = clock.processor().unwrap().since(start.processor.unwrap());
        // On a busy machine threads wait for a part of the time.
        let wanted = processor.ran + processor.waited;
        assert!(wanted > Duration::from_millis(45), "{processor:?}");
        assert!(processor.ran > Duration::ZERO, "{processor:?}");
        let time = clock.stop(&start);
        assert!(time.render_s > 0.0 && time.lost_s >= 0.0, "{time:?}");
    }

    #[test]
    fn more_threads_than_processors_get_their_share_of_them() {
        let processors = thread::available_parallelism().map_or(1, usize::from);
        for (threads, share) in [(1, 1.0), (processors, 1.0), (4 * processors, 0.25)] {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads);
            let clock = RenderClock::new(&pool.build().unwrap());
            assert_eq!(clock.own_share, share, "{threads} threads");
        }
    }

    #[test]
    fn a_late_look_counts_as_a_stop_unless_the_thread_waited_for_a_processor() {
        let begun = Instant::now();
        let second = Duration::from_secs(1);
        for (late, waited, stopped) in [
            (BEAT, Duration::ZERO, Duration::ZERO),
            (BEAT + STOPPED, Duration::ZERO, Duration::ZERO),
            (BEAT + second, Duration::ZERO, second),
            (BEAT + second, second, Duration::ZERO),
            (BEAT + 3 * second, second, 2 * second),
        ] {
            let mut watch = Watch {
                last: begun,
                stopped: second,
            };
            watch.look(begun + late, waited);
            assert_eq!(
                watch.stopped,
                second + stopped,
                "{late:?} late, {waited:?} waited"
            );
            assert_eq!(watch.last, begun + late);
        }
    }
}
