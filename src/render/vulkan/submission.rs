//! What is handed to the queue: recorded at once, waited for when its results are needed.

use std::sync::atomic::Ordering;
use std::sync::{Arc, PoisonError};
use std::time::Instant;

use ash::vk;

use super::device::Device;
use super::error::VulkanError;

/// How long a submission may take before it counts as stuck, in seconds. Dispatches are made to take a tenth of one.
const PATIENCE_S: u64 = 300;

/// The same of a device that is a program: it compiles shaders at their first dispatch, and shares its processor.
const PATIENCE_WITH_PROGRAMS_S: u64 = 1800;

/// From when to when the device worked on a submission, by its own clock.
#[derive(Clone, Copy, Debug)]
pub struct Span {
    begin: u64,
    end: u64,
    step_ns: f64,
    seconds: f64,
}

impl Span {
    /// Seconds of work.
    pub fn seconds(&self) -> f64 {
        self.seconds
    }

    /// Seconds from the end of an earlier submission to the beginning of this one; 0 where the device has no clock, or it was set
    /// back.
    pub fn since(&self, earlier: &Span) -> f64 {
        let known = self.step_ns > 0.0 && earlier.step_ns > 0.0;
        if known { self.begin.saturating_sub(earlier.end) as f64 * self.step_ns * 1e-9 } else { 0.0 }
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
            handed: Instant::now(),
            pending: false,
        };
        // Let go before `made`, which asks for it when it is dropped.
        let mut current = self.pass.lock().unwrap_or_else(PoisonError::into_inner);
        pass.clone_into(&mut current);
        // SAFETY: pool and queue belong to this device, and `current` keeps every other thread away from them. What was made is
        // destroyed when the submission is dropped, and it is not while the queue works on it.
        unsafe {
            let raw = &self.raw;
            made.commands = raw.allocate_command_buffers(&allocate).map_err(fail("vkAllocateCommandBuffers"))?[0];
            made.fence = raw.create_fence(&vk::FenceCreateInfo::default(), None).map_err(fail("vkCreateFence"))?;
            if self.info.limits.timestamp_ns > 0.0 {
                made.queries = raw.create_query_pool(&query_info, None).map_err(fail("vkCreateQueryPool"))?;
                self.name(made.queries, pass);
            }
            self.name(made.commands, pass);
            self.name(made.fence, pass);
            let commands = made.commands;
            raw.begin_command_buffer(commands, &begin).map_err(fail("vkBeginCommandBuffer"))?;
            if made.is_timed() {
                raw.cmd_reset_query_pool(commands, made.queries, 0, 2);
                // Once all that was handed over before is done.
                raw.cmd_write_timestamp(commands, vk::PipelineStageFlags::BOTTOM_OF_PIPE, made.queries, 0);
            }
            record(commands);
            if made.is_timed() {
                raw.cmd_write_timestamp(commands, vk::PipelineStageFlags::BOTTOM_OF_PIPE, made.queries, 1);
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
    fn is_timed(&self) -> bool {
        self.queries != vk::QueryPool::null()
    }

    /// Waits until the commands are done, and says when the device worked on them; without a clock of its own, from when they
    /// were handed over until now.
    ///
    /// # Errors
    /// When the device is lost, or does not finish.
    pub fn wait(mut self) -> Result<Span, VulkanError> {
        self.finish()?;
        let elapsed = self.handed.elapsed().as_secs_f64();
        let host = Span { begin: 0, end: 0, step_ns: 0.0, seconds: elapsed };
        if !self.is_timed() {
            return Ok(host);
        }
        let mut ticks = [0u64; 2];
        let flags = vk::QueryResultFlags::TYPE_64 | vk::QueryResultFlags::WAIT;
        // SAFETY: both queries were written by the commands that are done.
        unsafe { self.device.raw.get_query_pool_results(self.queries, 0, &mut ticks, flags) }
            .map_err(|r| self.device.failed("vkGetQueryPoolResults", r))?;
        let [begin, end] = ticks;
        let limits = &self.device.info.limits;
        let step_ns = limits.timestamp_ns;
        let seconds = (end.wrapping_sub(begin) & limits.timestamp_mask) as f64 * step_ns * 1e-9;
        // A clock that was set back says nothing.
        Ok(if seconds <= elapsed * 2.0 { Span { begin, end, step_ns, seconds } } else { host })
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
