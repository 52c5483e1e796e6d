//! What is handed to the queue: recorded at once, waited for when its results are needed.

use std::sync::atomic::Ordering;
use std::sync::{Arc, PoisonError};
use std::time::Instant;

use ash::vk;

use super::buffer::Readback;
use super::device::Device;
use super::error::VulkanError;

/// How long a submission may take before it counts as stuck, in seconds. Dispatches are made to take a tenth of one.
const PATIENCE_S: u64 = 300;

/// The same of a device that is a program: it compiles shaders at their first dispatch, and shares its processor.
const PATIENCE_WITH_PROGRAMS_S: u64 = 1800;

/// Bytes of two readings of the device's clock.
const TICKS: u64 = size_of::<[u64; 2]>() as u64;

/// From when to when the device worked on a submission, by its own clock.
#[derive(Clone, Copy, Debug)]
pub struct Span {
    begin: u64,
    end: u64,
    clock: Clock,
    seconds: f64,
}

/// How a queue's clock ticks.
#[derive(Clone, Copy, Debug, Default)]
struct Clock {
    /// Nanoseconds of a tick; 0 where there is no clock.
    step_ns: f64,
    /// The bits that it counts in.
    mask: u64,
}

impl Clock {
    /// Seconds between two readings; the clock may have begun again from zero in between, once.
    fn seconds(self, from: u64, to: u64) -> f64 {
        (to.wrapping_sub(from) & self.mask) as f64 * self.step_ns * 1e-9
    }

    /// Whether `to` was read after `from` and not before it: less than half a turn of the clock later.
    fn is_after(self, from: u64, to: u64) -> bool {
        to.wrapping_sub(from) & self.mask <= self.mask / 2
    }
}

impl Span {
    /// Seconds of work.
    pub fn seconds(&self) -> f64 {
        self.seconds
    }

    /// Seconds from the end of an earlier submission to the beginning of this one; 0 where the device has no clock, or it was set
    /// back.
    pub fn since(&self, earlier: &Span) -> f64 {
        let known = self.clock.step_ns > 0.0 && earlier.clock.step_ns > 0.0;
        if known && self.clock.is_after(earlier.end, self.begin) {
            self.clock.seconds(earlier.end, self.begin)
        } else {
            0.0
        }
    }
}

/// Commands that were handed to the queue. Dropped, they are waited for: what they use must live longer, and is destroyed after
/// it.
pub struct Submission {
    device: Arc<Device>,
    pass: String,
    commands: vk::CommandBuffer,
    fence: vk::Fence,
    /// When the commands began and ended, where the device has a clock.
    queries: vk::QueryPool,
    /// The same, copied here by the commands: to ask the pool waits for the whole queue on some drivers, and what comes behind is
    /// not to be waited for.
    ticks: Option<Readback>,
    handed: Instant,
    /// Whether the queue has them and they were not waited for yet.
    pending: bool,
}

impl Device {
    /// Records commands and hands them to the queue under the name `pass`, behind all that it has already; `after` records what
    /// is to follow them and is on no clock.
    ///
    /// # Errors
    /// When recording fails, or the device is lost.
    pub fn submit(
        self: &Arc<Device>,
        pass: &str,
        record: impl FnOnce(vk::CommandBuffer),
        after: impl FnOnce(vk::CommandBuffer),
    ) -> Result<Submission, VulkanError> {
        let fail = |call: &'static str| move |result| self.failed_in(call, result, pass.to_owned());
        let allocate = vk::CommandBufferAllocateInfo::default().command_pool(self.pool).command_buffer_count(1);
        let begin = vk::CommandBufferBeginInfo::default().flags(vk::CommandBufferUsageFlags::ONE_TIME_SUBMIT);
        let query_info = vk::QueryPoolCreateInfo::default().query_type(vk::QueryType::TIMESTAMP).query_count(2);
        let mut made = Submission {
            device: Arc::clone(self),
            pass: pass.to_owned(),
            commands: vk::CommandBuffer::null(),
            fence: vk::Fence::null(),
            queries: vk::QueryPool::null(),
            ticks: None,
            handed: Instant::now(),
            pending: false,
        };
        if self.info.limits.timestamp_ns > 0.0 {
            made.ticks = Some(Readback::new(self, TICKS)?);
        }
        // Let go before `made`, which asks for it when it is dropped.
        let mut current = self.pass.lock().unwrap_or_else(PoisonError::into_inner);
        pass.clone_into(&mut current);
        // SAFETY: pool and queue belong to this device, and `current` keeps every other thread away from them. What was made is
        // destroyed when the submission is dropped, and it is not while the queue works on it.
        unsafe {
            let raw = &self.raw;
            made.commands = raw.allocate_command_buffers(&allocate).map_err(fail("vkAllocateCommandBuffers"))?[0];
            made.fence = raw.create_fence(&vk::FenceCreateInfo::default(), None).map_err(fail("vkCreateFence"))?;
            if made.ticks.is_some() {
                made.queries = raw.create_query_pool(&query_info, None).map_err(fail("vkCreateQueryPool"))?;
                self.name(made.queries, pass);
            }
            self.name(made.commands, pass);
            self.name(made.fence, pass);
            let commands = made.commands;
            raw.begin_command_buffer(commands, &begin).map_err(fail("vkBeginCommandBuffer"))?;
            if made.ticks.is_some() {
                raw.cmd_reset_query_pool(commands, made.queries, 0, 2);
                // Once all that was handed over before is done.
                raw.cmd_write_timestamp(commands, vk::PipelineStageFlags::BOTTOM_OF_PIPE, made.queries, 0);
            }
            record(commands);
            if let Some(ticks) = &made.ticks {
                raw.cmd_write_timestamp(commands, vk::PipelineStageFlags::BOTTOM_OF_PIPE, made.queries, 1);
                ticks.record_ticks(commands, made.queries);
            }
            after(commands);
            raw.end_command_buffer(commands).map_err(fail("vkEndCommandBuffer"))?;
            let all = [commands];
            let submit = [vk::SubmitInfo::default().command_buffers(&all)];
            made.handed = Instant::now();
            raw.queue_submit(self.queue, &submit, made.fence).map_err(fail("vkQueueSubmit"))?;
            made.pending = true;
        }
        Ok(made)
    }
}

impl Submission {
    /// Waits until the commands are done, and says when the device worked on them; without a clock of its own, from when they
    /// were handed over until now.
    ///
    /// # Errors
    /// When the device is lost, or does not finish.
    pub fn wait(mut self) -> Result<Span, VulkanError> {
        self.finish()?;
        let elapsed = self.handed.elapsed().as_secs_f64();
        let host = Span { begin: 0, end: 0, clock: Clock::default(), seconds: elapsed };
        let Some(ticks) = &self.ticks else { return Ok(host) };
        let [begin, end]: [u64; 2] = bytemuck::pod_read_unaligned(&ticks.bytes()[..TICKS as usize]);
        let limits = &self.device.info.limits;
        let clock = Clock { step_ns: limits.timestamp_ns, mask: limits.timestamp_mask };
        let seconds = clock.seconds(begin, end);
        // A clock that was set back says nothing.
        Ok(if seconds <= elapsed * 2.0 { Span { begin, end, clock, seconds } } else { host })
    }

    fn finish(&mut self) -> Result<(), VulkanError> {
        if !std::mem::take(&mut self.pending) {
            return Ok(());
        }
        let device = &self.device;
        let patience_s = if device.info.software { PATIENCE_WITH_PROGRAMS_S } else { PATIENCE_S };
        // SAFETY: the fence is that of the commands which the queue has.
        let done = unsafe { device.raw.wait_for_fences(&[self.fence], true, patience_s * 1_000_000_000) };
        match done {
            Err(vk::Result::TIMEOUT) => {
                device.stuck.store(true, Ordering::Relaxed);
                Err(VulkanError::Stuck { device: device.info.line(), pass: self.pass.clone(), seconds: patience_s })
            }
            other => other.map_err(|r| device.failed_in("vkWaitForFences", r, self.pass.clone())),
        }
    }
}

impl Drop for Submission {
    fn drop(&mut self) {
        // Whoever wants to know has waited.
        let _ = self.finish();
        if self.device.is_stuck() {
            return;
        }
        let _alone = self.device.pass.lock().unwrap_or_else(PoisonError::into_inner);
        // SAFETY: the commands are done, lost, or were never handed over, and no other thread uses their pool.
        unsafe {
            if self.commands != vk::CommandBuffer::null() {
                self.device.raw.free_command_buffers(self.device.pool, &[self.commands]);
            }
            self.device.raw.destroy_query_pool(self.queries, None);
            self.device.raw.destroy_fence(self.fence, None);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn clocks_of_few_bits_begin_again_between_submissions_too() {
        let clock = Clock { step_ns: 50.0, mask: (1 << 36) - 1 };
        let span = |begin, end| Span { begin, end, clock, seconds: clock.seconds(begin, end) };
        let last = span(clock.mask - 999, clock.mask);
        let next = span(1_999, 5_999);
        assert!((last.seconds() - 999.0 * 50e-9).abs() < 1e-15);
        assert!((next.since(&last) - 2_000.0 * 50e-9).abs() < 1e-15, "{}", next.since(&last));
        assert_eq!(last.since(&next), 0.0, "what came before is not half an hour late");
        assert_eq!(Span { clock: Clock::default(), ..next }.since(&last), 0.0);
        let wide = Clock { step_ns: 1.0, mask: u64::MAX };
        assert!(wide.is_after(u64::MAX, 3) && !wide.is_after(3, u64::MAX));
    }
}
