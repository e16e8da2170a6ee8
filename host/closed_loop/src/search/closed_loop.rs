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
    /// Searches the axes of one stage from `base`, a point of the whole unit cube.
    ///
    /// A generation that the journal holds already is not scanned again: it is compared with the
    /// one that is asked for now, so a resumed search ends as an uninterrupted one does.
    ///
    /// # Errors
    ///
    /// [`TuneError`] of the optimiser, the sensor or the journal, and when interrupted.
    pub(super) fn closed_loop(&mut self, stage: &Stage, base: &[f64]) -> Result<CmaEs, TuneError> {
        self.evaluator.observer.stage(&stage.name, stage.registrations());
        let mut optimizer = self.optimizer(stage, base)?;
        for number in stage.place.generations.. {
            if optimizer.stop().is_some() {
                break;
            }
            let asked = self.ask(stage, number, &optimizer, base);
            let generation = match self.recorded.pop_front() {
                Some(recorded) => self.compared(recorded, &asked)?,
                None => self.scan_and_register(asked)?,
            };
            let fitness: Vec<f64> = generation.candidates.iter().map(|c| c.fitness).collect();
            // Never refused: there is one value for each candidate that was asked for.
            let _ = optimizer.tell(&fitness);
            self.evaluator.observer.generation(&generation, self.total);
            self.generations.push(generation);
        }
        Ok(optimizer)
    }
}
