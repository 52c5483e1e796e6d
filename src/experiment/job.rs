//! The job that renders the settings of a run.

use super::spec::CellConfig;
use lumbre_light::transport::integrator::integrator;
use lumbre_light::transport::sampler::sampler;
use lumbre_render::Job;

impl CellConfig {
    /// Returns the job that renders these settings with `threads` threads (0: one per core), with
    /// seed 0 from the first sample. `resolution` and `max_depth` are those of the scene, which
    /// apply where the settings leave them open.
    ///
    /// # Errors
    /// Returns a message if this version has no such integrator or sampler.
    pub fn job(&self, resolution: [u32; 2], max_depth: u32, threads: usize) -> Result<Job, String> {
        let name = &self.integrator;
        Ok(Job {
            integrator: integrator(name)
                .ok_or_else(|| format!("there is no integrator `{name}`"))?,
            params: self.params.clone(),
            resolution: self.resolution.unwrap_or(resolution),
            max_depth: self.max_depth.unwrap_or(max_depth),
            rr_start: self.rr_start,
            filter: self.filter,
            layers: self.films.clone(),
            timing: self.timing.clone(),
            sampler: sampler(&self.sampler)
                .ok_or_else(|| format!("there is no sampler `{}`", self.sampler))?,
            accel: self.accel,
            shaders: self.shaders.clone(),
            seed: 0,
            first_sample: 0,
            threads,
            view: None,
        })
    }
}
