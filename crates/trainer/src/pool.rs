//! One helper thread (or a few) that shares lists of independent pieces of work with the caller.
//!
//! Each thread begins with the pieces that it had the last time, whose data its core's caches hold, and takes from the others when it has
//! none left. Which thread does a piece is thus left open, what a piece computes is not: results never depend on the number of threads.
//! A piece takes tens of microseconds, so the helper spins for a moment before it sleeps.

use core::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::thread::JoinHandle;

/// How often the helper looks for work before it sleeps: about 20 µs.
const SPINS: u32 = 4000;

/// A pool of `threads` threads, the caller's own counted. A job has it to itself: nested calls do not compile.
pub(crate) struct Pool {
    shared: Arc<Shared>,
    helpers: Vec<JoinHandle<()>>,
    /// Whether the caller works without the helpers for now.
    alone: bool,
}

struct Shared {
    state: Mutex<State>,
    /// The helper sleeps on it.
    wake: Condvar,
    /// Counts jobs; a spinning helper watches it.
    generation: AtomicU64,
    /// For each thread the pieces of the current job that are left of its own.
    left: Vec<Own>,
    panicked: AtomicBool,
}

/// A thread's own pieces: of n threads each has every n-th of the list. It takes them from the first, others take them from the last.
/// On a cache line of its own.
#[derive(Default)]
#[repr(align(64))]
struct Own(AtomicU64);

impl Own {
    /// So many pieces, none taken.
    fn fill(&self, count: usize) {
        self.0.store((count as u64) << 32, Ordering::Relaxed);
    }

    /// The number of a piece that no one else gets.
    fn take(&self, from_last: bool) -> Option<usize> {
        let taken = self
            .0
            .fetch_update(Ordering::Relaxed, Ordering::Relaxed, |both| {
                let (first, end) = (both & u64::from(u32::MAX), both >> 32);
                (first < end).then(|| {
                    if from_last {
                        both - (1 << 32)
                    } else {
                        both + 1
                    }
                })
            });
        let both = taken.ok()?;
        let number = if from_last {
            (both >> 32) - 1
        } else {
            both & u64::from(u32::MAX)
        };
        Some(number as usize)
    }
}

#[derive(Default)]
struct State {
    job: Option<Job>,
    /// Helpers inside the current job.
    active: usize,
    stop: bool,
}

/// A borrowed closure whose lifetime the compiler no longer sees: [`Pool::for_each`] outlives every use.
#[derive(Clone, Copy)]
struct Job {
    run: *const (dyn Fn(usize) + Sync),
}

// SAFETY: the closure behind `run` is `Sync`, and `Pool::for_each` keeps it alive until no helper is inside.
unsafe impl Send for Job {}

/// A pointer to a slice's items, each of which is handed to one thread only.
struct Items<T>(*mut T);
// SAFETY: distinct indices give distinct items, and `T: Send` where this is used.
unsafe impl<T: Send> Sync for Items<T> {}

impl<T> Items<T> {
    /// # Safety
    /// `index` is within the slice, and no one else has this item.
    #[allow(clippy::mut_from_ref)]
    unsafe fn get(&self, index: usize) -> &mut T {
        // SAFETY: the caller's promise.
        unsafe { &mut *self.0.add(index) }
    }
}

fn lock(state: &Mutex<State>) -> MutexGuard<'_, State> {
    state.lock().unwrap_or_else(PoisonError::into_inner)
}

impl Pool {
    /// A pool of `threads` threads (at least the caller's). If the system gives fewer, the pool is smaller: results are the same.
    pub(crate) fn new(threads: usize) -> Self {
        let shared = Arc::new(Shared {
            state: Mutex::default(),
            wake: Condvar::new(),
            generation: AtomicU64::new(0),
            left: (0..threads.max(1)).map(|_| Own::default()).collect(),
            panicked: AtomicBool::new(false),
        });
        let spawn = |thread| {
            let shared = Arc::clone(&shared);
            let builder = std::thread::Builder::new().name("trainer".into());
            builder.spawn(move || help(&shared, thread)).ok()
        };
        let helpers = (1..threads).filter_map(spawn).collect();
        Self {
            shared,
            helpers,
            alone: false,
        }
    }

    /// Threads that it was made with, the caller's own counted.
    pub(crate) fn threads(&self) -> usize {
        self.shared.left.len()
    }

    /// Leaves the helpers out from now on, or takes them in again.
    pub(crate) fn set_alone(&mut self, alone: bool) {
        self.alone = alone;
    }

    /// Calls `work` once for each item, on whichever thread is free. One call at a time: `work` itself cannot call it again, which
    /// would take the job out from under the first.
    pub(crate) fn for_each<T: Send>(&mut self, items: &mut [T], work: impl Fn(&mut T) + Sync) {
        if self.alone || self.helpers.is_empty() || items.len() < 2 {
            return items.iter_mut().for_each(work);
        }
        let count = items.len();
        let items = Items(items.as_mut_ptr());
        // SAFETY: `left` hands out each index below `count` once.
        let run = |index: usize| work(unsafe { items.get(index) });
        let run: &(dyn Fn(usize) + Sync) = &run;
        // SAFETY: only the lifetime changes; `finish` waits until no helper uses it, also when `work` panics here.
        let run: *const (dyn Fn(usize) + Sync + 'static) = unsafe { core::mem::transmute(run) };
        let job = Job { run };
        let threads = self.shared.left.len();
        for (thread, own) in self.shared.left.iter().enumerate() {
            own.fill((count + threads - 1 - thread) / threads);
        }
        self.shared.panicked.store(false, Ordering::Relaxed);
        {
            // Both under the lock: a helper about to sleep sees the new number, or is woken.
            let mut state = lock(&self.shared.state);
            state.job = Some(job);
            self.shared.generation.fetch_add(1, Ordering::Release);
        }
        self.shared.wake.notify_all();
        let finish = Finish(&self.shared);
        self.shared.take_pieces(job, 0);
        drop(finish);
        assert!(
            !self.shared.panicked.load(Ordering::Relaxed),
            "a training thread panicked"
        );
    }
}

/// Closes the job and waits for the helpers inside it.
struct Finish<'a>(&'a Shared);

impl Drop for Finish<'_> {
    fn drop(&mut self) {
        // Nothing is left, or this thread panicked and nothing more shall start.
        self.0.left.iter().for_each(|own| own.fill(0));
        let mut spins = 0;
        loop {
            let mut state = lock(&self.0.state);
            state.job = None;
            if state.active == 0 {
                return;
            }
            drop(state);
            for _ in 0..50 {
                core::hint::spin_loop();
            }
            spins += 1;
            if spins > 20 {
                std::thread::yield_now();
            }
        }
    }
}

impl Shared {
    /// Works until no piece is left, as thread number `this`.
    fn take_pieces(&self, job: Job, this: usize) {
        let threads = self.left.len();
        for ahead in 0..threads {
            let whose = (this + ahead) % threads;
            while let Some(number) = self.left[whose].take(ahead > 0) {
                // SAFETY: the job is open, so `for_each` still holds the closure.
                unsafe { (*job.run)(whose + number * threads) };
            }
        }
    }
}

/// A helper's life.
fn help(shared: &Shared, this: usize) {
    let mut seen = 0;
    loop {
        for _ in 0..SPINS {
            if shared.generation.load(Ordering::Acquire) != seen {
                break;
            }
            core::hint::spin_loop();
        }
        let mut state = lock(&shared.state);
        while shared.generation.load(Ordering::Acquire) == seen && !state.stop {
            state = shared
                .wake
                .wait(state)
                .unwrap_or_else(PoisonError::into_inner);
        }
        if state.stop {
            return;
        }
        seen = shared.generation.load(Ordering::Acquire);
        let Some(job) = state.job else { continue };
        state.active += 1;
        drop(state);
        let done = std::panic::catch_unwind(core::panic::AssertUnwindSafe(|| {
            shared.take_pieces(job, this)
        }));
        if done.is_err() {
            shared.panicked.store(true, Ordering::Relaxed);
        }
        lock(&shared.state).active -= 1;
    }
}

impl Drop for Pool {
    fn drop(&mut self) {
        lock(&self.shared.state).stop = true;
        self.shared.generation.fetch_add(1, Ordering::Release);
        self.shared.wake.notify_all();
        for helper in self.helpers.drain(..) {
            // A helper that panicked has said so already.
            let _ = helper.join();
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_item_is_worked_on_once() {
        let mut pool = Pool::new(2);
        let mut items: Vec<u32> = (0..100).collect();
        for _ in 0..1000 {
            pool.for_each(&mut items, |item| *item += 1);
        }
        assert_eq!(items, (1000..1100).collect::<Vec<_>>());
    }

    #[test]
    fn a_panic_in_a_piece_reaches_the_caller_and_leaves_the_pool_usable() {
        let mut pool = Pool::new(2);
        let result = std::panic::catch_unwind(core::panic::AssertUnwindSafe(|| {
            pool.for_each(&mut [0_u32; 64], |_| panic!("planned"));
        }));
        assert!(result.is_err());
        // As if a helper had panicked too, which is left to chance here.
        pool.shared.panicked.store(true, Ordering::Relaxed);
        let mut items = [1_u32; 8];
        pool.for_each(&mut items, |item| *item += 1);
        assert_eq!(items, [2; 8]);
    }
}
