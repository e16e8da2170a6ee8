//! Front end without a sensor: for a board that has a link and a processor, and no laser.

use echoloop_dsp::{Hardware, ScanPattern, Settings};
use echoloop_frontend::FrontEnd;
use echoloop_sensor::Board;
use echoloop_sensor::afe::{self, AfeError};

use crate::boards::nor_flash::RamNorFlash;
use crate::boards::pc::PcBoard;

/// Shots as a sensor's program fires them, by the same drivers and registers.
pub struct Shots<F> {
    board: PcBoard<F>,
    settings: Settings,
    /// Scan pattern with the aim of the settings.
    pattern: ScanPattern,
}

impl<F: FrontEnd> Shots<F> {
    /// Front end with default settings. `hardware.adc_bits` is taken from it.
    pub fn new(front_end: F, pattern: ScanPattern, hardware: Hardware) -> Self {
        let board = PcBoard::new(front_end, pattern, hardware, RamNorFlash::default());
        Self { board, settings: Settings::default(), pattern }
    }

    /// Front end, to give it another scene.
    pub fn front_end_mut(&mut self) -> &mut F {
        self.board.front_end_mut()
    }

    /// Applies settings and begins a scan.
    ///
    /// # Errors
    ///
    /// [`AfeError`] for settings that fail their check, which the registers do not hold.
    pub fn begin(&mut self, settings: &Settings, frame: u32) -> Result<(), AfeError> {
        afe::apply(settings, &mut self.board)?;
        afe::begin_frame(self.board.emitter(), frame)?;
        self.settings = *settings;
        // Settings that the sensor holds have passed this check.
        self.pattern = self.board.pattern().aimed(settings).map_err(|_| AfeError::Bus)?;
        Ok(())
    }

    /// Fires a shot, and writes all its codes.
    ///
    /// # Errors
    ///
    /// [`AfeError::Bus`] when `codes` is longer or shorter than the settings make.
    pub fn fire(&mut self, beam: u32, shot: u32, codes: &mut [u16]) -> Result<(), AfeError> {
        afe::fire(&mut self.board, &self.settings, &self.pattern, beam, shot)?;
        if self.board.samples(codes) { Ok(()) } else { Err(AfeError::Bus) }
    }
}
