//! Submissions to the queue: recorded at once, waited for when their results are needed.

use std::sync::atomic::Ordering;
use std::sync::{Arc, PoisonError};
use std::time::Instant;

use ash::vk;

use crate::context::device::Device;
use crate::error::VulkanError;
use crate::memory::buffer::Readback;

/// Timeout of a submission in seconds. Dispatches aim at less than a tenth of one.
const TIMEOUT_S: u64 = 300;

/// Timeout on software devices in seconds: they compile shaders at the first dispatch and share the
/// CPU.
const SOFTWARE_TIMEOUT_S: u64 = 1800;

/// Size of two timestamps in bytes.
const TICKS: u64 = size_of::<[u64; 2]>() as u64;

/// Interval in which the device worked on a submission, by its own clock.
#[derive(Clone, Copy, Debug)]
pub struct Span {
    begin: u64,
    end: u64,
    clock: Clock,
    seconds: f64,
}

/// Properties of a queue's clock.
#[derive(Clone, Copy, Debug, Default)]
struct Clock {
    /// Period in nanoseconds; 0 without a clock.
    step_ns: f64,
    /// Mask of the valid bits of a timestamp.
    mask: u64,
}

impl Clock {
    /// Returns the seconds between two timestamps, between which the clock may wrap around once.
    fn seconds(self, from: u64, to: u64) -> f64 {
        (to.wrapping_sub(from) & self.mask) as f64 * self.step_ns * 1e-9
    }

    /// Returns whether `to` is later than `from`: by less than half of the clock's range.
    fn is_after(self, from: u64, to: u64) -> bool {
        to.wrapping_sub(from) & self.mask <= self.mask / 2
    }
}

impl Span {
    /// Returns the duration in seconds.
    pub fn seconds(&self) -> f64 {
        self.seconds
    }

    /// Returns the seconds from the end of an earlier submission to the start of this one; 0 if the
    /// device has no clock, or it was reset.
    pub fn since(&self, earlier: &Span) -> f64 {
        let known = self.clock.step_ns > 0.0 && earlier.clock.step_ns > 0.0;
        if known && self.clock.is_after(earlier.end, self.begin) {
            self.clock.seconds(earlier.end, self.begin)
        } else {
            0.0
        }
    }
}

/// Submitted commands. Dropping it waits for them, so objects that they use must be dropped later.
pub struct Submission {
    device: Arc<Device>,
    pass: String,
    commands: vk::CommandBuffer,
    fence: vk::Fence,
    /// Timestamps of start and end, if the device has a clock.
    queries: vk::QueryPool,
    /// Host copy of the timestamps, written by the commands. Reading the query pool would wait for
    /// the whole queue on some drivers, including later submissions.
    ticks: Option<Readback>,
    submitted: Instant,
    /// Whether the commands were submitted and not waited for yet.
    pending: bool,
}

impl Device {
    /// Records commands and submits them as the pass `pass`, after all earlier submissions; `after`
    /// records untimed commands that follow them.
    ///
    /// # Errors
    /// Returns an error if recording fails or the device is lost.
    pub fn submit(
        self: &Arc<Device>,
        pass: &str,
        record: impl FnOnce(vk::CommandBuffer),
        after: impl FnOnce(vk::CommandBuffer),
    ) -> Result<Submission, VulkanError> {
        let fail = |call: &'static str| move |result| self.failed_in(call, result, pass.to_owned());
        let allocate = vk::CommandBufferAllocateInfo::default()
            .command_pool(self.pool)
            .command_buffer_count(1);
        let query_info = vk::QueryPoolCreateInfo::default()
            .query_type(vk::QueryType::TIMESTAMP)
            .query_count(2);
        let mut made = Submission {
            device: Arc::clone(self),
            pass: pass.to_owned(),
            commands: vk::CommandBuffer::null(),
            fence: vk::Fence::null(),
            queries: vk::QueryPool::null(),
            ticks: None,
            submitted: Instant::now(),
            pending: false,
        };
        if self.info.limits.timestamp_ns > 0.0 {
            made.ticks = Some(Readback::new(self, TICKS)?);
        }
        // Released before `made` is dropped, which locks it again.
        let mut current = self.pass.lock().unwrap_or_else(PoisonError::into_inner);
        pass.clone_into(&mut current);
        // SAFETY: pool and queue belong to this device, and `current` excludes all other threads.
        // The objects are destroyed when the submission is dropped, and not while the queue uses
        // them.
        unsafe {
            let raw = &self.raw;
            made.commands = raw
                .allocate_command_buffers(&allocate)
                .map_err(fail("vkAllocateCommandBuffers"))?[0];
            made.fence = raw
                .create_fence(&vk::FenceCreateInfo::default(), None)
                .map_err(fail("vkCreateFence"))?;
            if made.ticks.is_some() {
                made.queries = raw
                    .create_query_pool(&query_info, None)
                    .map_err(fail("vkCreateQueryPool"))?;
                self.name(made.queries, pass);
            }
            self.name(made.commands, pass);
            self.name(made.fence, pass);
            let commands = made.commands;
            made.record(record, after)?;
            let all = [commands];
            let submit = [vk::SubmitInfo::default().command_buffers(&all)];
            made.submitted = Instant::now();
            raw.queue_submit(self.queue, &submit, made.fence)
                .map_err(fail("vkQueueSubmit"))?;
            made.pending = true;
        }
        Ok(made)
    }
}

impl Submission {
    /// Records the commands between two timestamps, if the device has a clock, and untimed ones
    /// after them.
    fn record(
        &self,
        record: impl FnOnce(vk::CommandBuffer),
        after: impl FnOnce(vk::CommandBuffer),
    ) -> Result<(), VulkanError> {
        let (raw, commands) = (&self.device.raw, self.commands);
        let fail = |call: &'static str| {
            move |result| self.device.failed_in(call, result, self.pass.clone())
        };
        let begin = vk::CommandBufferBeginInfo::default()
            .flags(vk::CommandBufferUsageFlags::ONE_TIME_SUBMIT);
        // SAFETY: commands and queries belong to this submission, and the caller excludes all other
        // threads from their pool.
        unsafe {
            raw.begin_command_buffer(commands, &begin)
                .map_err(fail("vkBeginCommandBuffer"))?;
            if self.ticks.is_some() {
                raw.cmd_reset_query_pool(commands, self.queries, 0, 2);
                // Taken once all earlier submissions are done.
                raw.cmd_write_timestamp(
                    commands,
                    vk::PipelineStageFlags::BOTTOM_OF_PIPE,
                    self.queries,
                    0,
                );
            }
            record(commands);
            if let Some(ticks) = &self.ticks {
                raw.cmd_write_timestamp(
                    commands,
                    vk::PipelineStageFlags::BOTTOM_OF_PIPE,
                    self.queries,
                    1,
                );
                ticks.record_ticks(commands, self.queries);
            }
            after(commands);
            raw.end_command_buffer(commands)
                .map_err(fail("vkEndCommandBuffer"))?;
        }
        Ok(())
    }

    /// Waits until the commands are done and returns when the device worked on them; without a
    /// device clock, the interval from the submission until now.
    ///
    /// # Errors
    /// Returns an error if the device is lost or does not finish in time.
    pub fn wait(mut self) -> Result<Span, VulkanError> {
        self.finish()?;
        let elapsed = self.submitted.elapsed().as_secs_f64();
        let host = Span {
            begin: 0,
            end: 0,
            clock: Clock::default(),
            seconds: elapsed,
        };
        let Some(ticks) = &self.ticks else {
            return Ok(host);
        };
        let [begin, end]: [u64; 2] = bytemuck::pod_read_unaligned(&ticks.bytes()[..TICKS as usize]);
        let limits = &self.device.info.limits;
        let clock = Clock {
            step_ns: limits.timestamp_ns,
            mask: limits.timestamp_mask,
        };
        let seconds = clock.seconds(begin, end);
        // Timestamps of a clock that was reset are invalid.
        Ok(if seconds <= elapsed * 2.0 {
            Span {
                begin,
                end,
                clock,
                seconds,
            }
        } else {
            host
        })
    }

    fn finish(&mut self) -> Result<(), VulkanError> {
        if !std::mem::take(&mut self.pending) {
            return Ok(());
        }
        let device = &self.device;
        let timeout_s = if device.info.software {
            SOFTWARE_TIMEOUT_S
        } else {
            TIMEOUT_S
        };
        // SAFETY: the fence belongs to the submitted commands.
        let done = unsafe {
            device
                .raw
                .wait_for_fences(&[self.fence], true, timeout_s * 1_000_000_000)
        };
        match done {
            Err(vk::Result::TIMEOUT) => {
                device.stuck.store(true, Ordering::Relaxed);
                Err(VulkanError::Stuck {
                    device: device.info.line(),
                    pass: self.pass.clone(),
                    seconds: timeout_s,
                })
            }
            other => other.map_err(|r| device.failed_in("vkWaitForFences", r, self.pass.clone())),
        }
    }
}

impl Drop for Submission {
    fn drop(&mut self) {
        // Callers that need the result have already waited.
        let _ = self.finish();
        if self.device.is_stuck() {
            return;
        }
        let _lock = self
            .device
            .pass
            .lock()
            .unwrap_or_else(PoisonError::into_inner);
        // SAFETY: the commands are done, lost, or were never submitted, and no other thread uses
        // their pool.
        unsafe {
            if self.commands != vk::CommandBuffer::null() {
                self.device
                    .raw
                    .free_command_buffers(self.device.pool, &[self.commands]);
            }
            self.device.raw.destroy_query_pool(self.queries, None);
            self.device.raw.destroy_fence(self.fence, None);
        }
    }
}

#[cfg(test)]
mod tests {
    use crate::schedule::submission::*;

    #[test]
    fn clocks_may_wrap_around_between_submissions() {
        let clock = Clock {
            step_ns: 50.0,
            mask: (1 << 36) - 1,
        };
        let span = |begin, end| Span {
            begin,
            end,
            clock,
            seconds: clock.seconds(begin, end),
        };
        let last = span(clock.mask - 999, clock.mask);
        let next = span(1_999, 5_999);
        assert!((last.seconds() - 999.0 * 50e-9).abs() < 1e-15);
        assert!(
            (next.since(&last) - 2_000.0 * 50e-9).abs() < 1e-15,
            "{}",
            next.since(&last)
        );
        assert_eq!(
            last.since(&next),
            0.0,
            "an earlier submission does not follow a later one"
        );
        assert_eq!(
            Span {
                clock: Clock::default(),
                ..next
            }
            .since(&last),
            0.0
        );
        let wide = Clock {
            step_ns: 1.0,
            mask: u64::MAX,
        };
        assert!(wide.is_after(u64::MAX, 3) && !wide.is_after(3, u64::MAX));
    }
}
