//! The closed loop of Sec. 4.2: ask, scan, register, tell, until the optimiser stops.
//!
//! ```text
//! Θ ~ CMA-ES ─▶ settings to the sensor, scans back ─▶ registration ─▶ ‖T − T*‖_F ─▶ CMA-ES
//! ```

use echoloop_cmaes::CmaEs;

use super::search_run::SearchRun;
use super::stage::Stage;
use super::tune_search::TuneError;

impl SearchRun<'_> {
    /// Searches the axes of some stages, each from a point of the whole unit cube, a generation of
    /// each at a time: there is more to do at once than one stage has for many threads. Each finds
    /// what it finds alone.
    ///
    /// A generation that the journal holds already is not scanned again: it is compared with the
    /// one that is asked for now, so a resumed search ends as an uninterrupted one does.
    ///
    /// # Errors
    ///
    /// [`TuneError`] of the optimiser, the sensor or the journal, and when interrupted.
    pub(super) fn closed_loop(
        &mut self,
        stages: &[(&Stage, Vec<f64>)],
    ) -> Result<Vec<CmaEs>, TuneError> {
        if stages.is_empty() {
            return Ok(Vec::new());
        }
        let names: Vec<&str> = stages.iter().map(|(stage, _)| &*stage.name).collect();
        let registrations = stages.iter().map(|(stage, _)| stage.registrations()).sum();
        self.evaluator.observer.stage(&names.join(", "), registrations);
        let optimizer = |(stage, base): &(&Stage, Vec<f64>)| self.optimizer(stage, base);
        let mut optimizers = stages.iter().map(optimizer).collect::<Result<Vec<_>, _>>()?;
        for step in 0.. {
            let running = |&i: &usize| optimizers[i].stop().is_none();
            let running: Vec<usize> = (0..stages.len()).filter(running).collect();
            if running.is_empty() {
                break;
            }
            let ask = |(place, &i): (usize, &usize)| {
                let (stage, base) = &stages[i];
                self.ask(stage, (place, step), &optimizers[i], base)
            };
            let asked = running.iter().enumerate().map(ask).collect();
            for (generation, &i) in self.scan_and_register(asked)?.into_iter().zip(&running) {
                let fitness: Vec<f64> = generation.candidates.iter().map(|c| c.fitness).collect();
                // Never refused: there is one value for each candidate that was asked for.
                let _ = optimizers[i].tell(&fitness);
                self.evaluator.observer.generation(&generation, self.total);
                self.generations.push(generation);
            }
        }
        Ok(optimizers)
    }
}
