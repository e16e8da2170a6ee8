//! Image of a sensor in QEMU: the program of a microcontroller, its serial link, and a front end in
//! shared memory.
//!
//! The emulator maps a file as the board's PSRAM; [`mailbox`] is its layout. When the sensor rings
//! the doorbell for a shot, this side writes the front end's samples into the converter's buffer.
//! It does so in the caller's thread, while that waits for the sensor's answer: there is no second
//! thread.

mod guard;

use std::fs::{self, File, OpenOptions};
use std::io::{self, Read, Write};
use std::os::unix::net::UnixStream;
use std::os::unix::process::CommandExt;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::sync::atomic::{AtomicU32, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError, Weak};
use std::thread;
use std::time::{Duration, Instant};

use echoloop_dsp::{Hardware, MAX_CODES, ScanPattern};
use echoloop_files::one_line;
use echoloop_sensor::afe::{adc, emitter};
use echoloop_sensor::mailbox;
use memmap2::{MmapOptions, MmapRaw};
use object::{Architecture, Object, ObjectSegment};
use thiserror::Error;

use crate::boards::pc::{read_analog, read_noise, read_trigger};
use crate::transport::{Transport, may_go_on};
use echoloop_frontend::FrontEnd;
use guard::Guard;

/// Board that QEMU emulates, with an image for it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Machine {
    /// Arm MPS2 AN385, Cortex-M3: runs the image for the Cortex-M0.
    An385,
    /// Arm MPS2 AN386, Cortex-M4F: the reference board.
    An386,
    /// Arm MPS2 AN500, Cortex-M7.
    An500,
    /// Arm MPS2 AN505, Cortex-M33.
    An505,
    /// Arm MPS3 AN547, Cortex-M55.
    An547,
    /// RISC-V virt, RV32IMAC.
    Virt,
    /// Netduino Plus 2, STM32F405, Cortex-M4F: a part on sale, without a front end.
    NetduinoPlus2,
}

impl Machine {
    /// All boards, the reference board first.
    pub const ALL: [Self; 7] = [
        Self::An386,
        Self::An500,
        Self::An505,
        Self::An547,
        Self::An385,
        Self::Virt,
        Self::NetduinoPlus2,
    ];

    /// True for a front end in shared memory. A board without one is fed waveforms over its link.
    pub const fn has_front_end(self) -> bool {
        self.memory().is_some()
    }

    /// QEMU's name.
    pub const fn name(self) -> &'static str {
        match self {
            Self::An385 => "mps2-an385",
            Self::An386 => "mps2-an386",
            Self::An500 => "mps2-an500",
            Self::An505 => "mps2-an505",
            Self::An547 => "mps3-an547",
            Self::Virt => "virt",
            Self::NetduinoPlus2 => "netduinoplus2",
        }
    }

    /// Machine by its name.
    pub fn from_name(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|machine| machine.name() == name)
    }

    /// Target of its image, as in `cargo xtask firmware --target`.
    pub const fn target(self) -> &'static str {
        match self {
            Self::An385 => "thumbv6m-none-eabi",
            Self::An386 | Self::An500 | Self::NetduinoPlus2 => "thumbv7em-none-eabihf",
            Self::An505 => "thumbv8m.main-none-eabihf",
            Self::An547 => "cortex-m55",
            Self::Virt => "riscv32imac-unknown-none-elf",
        }
    }

    /// Program of the emulator.
    pub const fn emulator(self) -> &'static str {
        match self {
            Self::Virt => "qemu-system-riscv32",
            _ => "qemu-system-arm",
        }
    }

    /// Path of the image of `cargo xtask firmware`, below the root of the workspace.
    pub fn image(self) -> PathBuf {
        let program = match self {
            Self::NetduinoPlus2 => "firmware/echoloop-stm32f405",
            _ => "firmware/echoloop-sensor",
        };
        let folder = match self {
            // The compiler has no target of this name: its folder holds that of the M33.
            Self::An547 => "cortex-m55/thumbv8m.main-none-eabihf",
            _ => self.target(),
        };
        Path::new("target/firmware").join(folder).join(program)
    }

    /// Architecture in its ELF files, and address of its flash.
    const fn code(self) -> (Architecture, u64) {
        match self {
            Self::An385 | Self::An386 | Self::An500 => (Architecture::Arm, 0),
            Self::An505 | Self::An547 => (Architecture::Arm, 0x1000_0000),
            Self::Virt => (Architecture::Riscv32, 0x8000_0000),
            Self::NetduinoPlus2 => (Architecture::Arm, 0x0800_0000),
        }
    }

    /// RAM whose first 16 MB hold the initial stack of its images, the first word of an Arm's
    /// flash. It tells boards apart whose flash has the same address.
    const fn stack(self) -> Option<u32> {
        match self {
            Self::An505 => Some(0x3800_0000),
            Self::An547 => Some(0x3000_0000),
            _ => None,
        }
    }

    /// Size of the shared memory and offset of the mailbox in it, bytes; `None` without shared
    /// memory, and so without a front end.
    const fn memory(self) -> Option<(u64, u64)> {
        match self {
            Self::Virt => Some((32 << 20, 16 << 20)), // all of its RAM
            Self::An547 => Some((2 << 30, 0)),        // all of its DDR4, of which little is touched
            Self::NetduinoPlus2 => None,
            _ => Some((16 << 20, 0)),
        }
    }
}

/// Reason that there is no emulated sensor.
#[derive(Debug, Error)]
pub enum QemuError {
    /// The emulator is not installed.
    #[error("{program} is not on the PATH (Debian: apt-get install {package})")]
    NotInstalled {
        /// Program.
        program: &'static str,
        /// Package of Debian.
        package: &'static str,
    },
    /// The image does not exist.
    #[error("no image {}: build it with `cargo xtask firmware --target {target}`", path.display())]
    NoImage {
        /// Path.
        path: PathBuf,
        /// Target that it is built for.
        target: &'static str,
    },
    /// The image is for another machine.
    #[error("{}: {what}", path.display())]
    BadImage {
        /// Path.
        path: PathBuf,
        /// Fault.
        what: String,
    },
    /// The emulator ended or did not start in time.
    #[error("{machine} in QEMU: {what}")]
    Failed {
        /// Name of the machine.
        machine: &'static str,
        /// Event, and the error output.
        what: String,
    },
    /// Failed operation on memory, folder or program.
    #[error("cannot {what}: {source}")]
    Io {
        /// Operation and path.
        what: String,
        /// Reason.
        source: io::Error,
    },
}

/// Options of an emulated sensor.
#[derive(Clone, Debug)]
pub struct QemuOptions {
    /// Machine.
    pub machine: Machine,
    /// Image, an ELF file.
    pub image: PathBuf,
    /// Folder of memory, log and socket, kept so that the sensor finds its flash again. `None` for
    /// a new folder that is removed.
    pub folder: Option<PathBuf>,
    /// Further arguments for the emulator.
    pub arguments: Vec<String>,
}

impl QemuOptions {
    /// Machine with the image of `cargo xtask firmware` below `workspace`.
    pub fn new(machine: Machine, workspace: &Path) -> Self {
        Self {
            machine,
            image: workspace.join(machine.image()),
            folder: None,
            arguments: Vec::new(),
        }
    }
}

/// Sensor in QEMU: bytes in, bytes out.
pub struct Qemu<F> {
    emulator: Arc<Mutex<Emulator>>,
    link: UnixStream,
    page: Option<Page>,
    front_end: F,
    shots: u32,
    codes: Vec<u16>,
    machine: Machine,
    folder: PathBuf,
}

/// Process of the emulator, and the guard that cleans up if this process is killed.
struct Emulator {
    child: Child,
    guard: Option<Guard>,
}

impl Emulator {
    /// Starts and lists an emulator under one lock, so that [`stop_all`] finds every one.
    fn start(
        options: &QemuOptions,
        folder: &Path,
        guard: Guard,
    ) -> Result<Arc<Mutex<Self>>, QemuError> {
        let mut running = lock(&RUNNING);
        let Some(running) = running.as_mut() else {
            let what = "the process is about to end".into();
            return Err(QemuError::Failed { machine: options.machine.name(), what });
        };
        let child = spawn(options, folder, guard.group())?;
        let emulator = Arc::new(Mutex::new(Self { child, guard: Some(guard) }));
        running.push(Arc::downgrade(&emulator));
        Ok(emulator)
    }

    fn stop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
        drop(self.guard.take());
    }
}

/// Emulators of this process, for [`stop_all`]; `None` after it.
static RUNNING: Mutex<Option<Vec<Weak<Mutex<Emulator>>>>> = Mutex::new(Some(Vec::new()));

/// Ends every emulator of this process, removes their folders, and lets no other start: before an
/// exit that drops nothing. A second caller waits for the first.
pub fn stop_all() {
    let mut running = lock(&RUNNING);
    let emulators = running.take().into_iter().flatten();
    emulators.filter_map(|emulator| emulator.upgrade()).for_each(|emulator| lock(&emulator).stop());
}

fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

impl<F: FrontEnd> Qemu<F> {
    /// Starts a sensor. `hardware.adc_bits` is taken from the front end. A machine without a front
    /// end in memory has its own hardware and pattern, and ignores the arguments.
    pub fn start(
        options: &QemuOptions,
        front_end: F,
        pattern: ScanPattern,
        hardware: Hardware,
    ) -> Result<Self, QemuError> {
        let QemuOptions { machine, image, .. } = options;
        check_installed(*machine)?;
        check_image(*machine, image)?;
        let (folder, guard) = folder(options)?;
        let hardware = Hardware { adc_bits: front_end.adc_bits(), ..hardware };
        let straps = mailbox::straps(&hardware, &pattern);
        let page = match machine.memory() {
            Some(place) => Some(Page::make(place, &folder.join(MEMORY), &straps)?),
            None => {
                blank_flash(&folder)?;
                None
            }
        };
        let emulator = Emulator::start(options, &folder, guard)?;
        let link = connect(&emulator, *machine, &folder).inspect_err(|_| lock(&emulator).stop())?;
        let codes = vec![0; MAX_CODES];
        Ok(Self { emulator, link, page, front_end, shots: 0, codes, machine: *machine, folder })
    }

    /// Front end, to give it another scene.
    pub fn front_end_mut(&mut self) -> &mut F {
        &mut self.front_end
    }

    /// Emulated machine.
    pub fn machine(&self) -> Machine {
        self.machine
    }

    /// Folder with memory, log and socket.
    pub fn folder(&self) -> &Path {
        &self.folder
    }

    /// Path of the log, defmt's frames.
    pub fn log_file(&self) -> PathBuf {
        self.folder.join(LOG)
    }

    /// Answers the doorbell. False when it has not rung.
    fn serve(&mut self) -> bool {
        let Some(page) = &self.page else { return false };
        let shots = page.read(mailbox::DOORBELL);
        if shots == self.shots {
            return false;
        }
        let register = |device: usize, register: u8| page.read(device + 4 * usize::from(register));
        let emitter = |number| register(mailbox::EMITTER, number);
        let adc = |number| register(mailbox::ADC, number);
        let analog = read_analog(&emitter, &adc);
        let samples =
            (adc(adc::SAMPLES) as usize).saturating_add(analog.pre_trigger).min(MAX_CODES);
        self.front_end.name_noise(read_noise(&emitter));
        self.front_end.steer(emitter(emitter::CELL));
        self.front_end.capture(&analog, read_trigger(&emitter), &mut self.codes[..samples]);
        page.write_codes(&self.codes[..samples]);
        self.shots = shots;
        page.write(mailbox::ANSWER, shots);
        true
    }

    /// Error of a broken line, with the emulator's own if it has ended.
    fn ended(&mut self, error: io::Error) -> io::Error {
        // The socket closes a moment before the process ends.
        let deadline = Instant::now() + Duration::from_secs(1);
        loop {
            if let Some(what) = failure(&self.emulator, self.machine, &self.folder) {
                return io::Error::new(error.kind(), what);
            }
            if Instant::now() > deadline {
                return error;
            }
            thread::sleep(Duration::from_millis(5));
        }
    }
}

impl<F: FrontEnd> Transport for Qemu<F> {
    /// Fails when the emulator has ended, or takes nothing for seconds.
    fn send(&mut self, mut bytes: &[u8]) -> io::Result<()> {
        let deadline = Instant::now() + STARTING;
        let mut idle = Idle::default();
        while !bytes.is_empty() {
            match self.link.write(bytes) {
                Ok(0) => return Err(self.ended(io::ErrorKind::WriteZero.into())),
                Ok(sent) => bytes = &bytes[sent..],
                Err(error) if may_go_on(&error) && Instant::now() < deadline => {
                    self.serve();
                    idle.wait();
                }
                Err(error) => return Err(self.ended(error)),
            }
        }
        Ok(())
    }

    /// Serves shots meanwhile.
    fn receive(&mut self, buffer: &mut [u8], timeout: Duration) -> io::Result<usize> {
        let deadline = Instant::now() + timeout;
        let mut idle = Idle::default();
        loop {
            if self.serve() {
                idle = Idle::default();
                continue; // it will ring again before it answers
            }
            match self.link.read(buffer) {
                Ok(0) => return Err(self.ended(io::ErrorKind::UnexpectedEof.into())),
                Ok(length) => return Ok(length),
                Err(error) if may_go_on(&error) => {}
                Err(error) => return Err(self.ended(error)),
            }
            if Instant::now() >= deadline {
                return Ok(0);
            }
            idle.wait();
        }
    }
}

impl<F> Drop for Qemu<F> {
    fn drop(&mut self) {
        lock(&self.emulator).stop();
        let others = |emulator: &Weak<_>| {
            emulator.strong_count() > 0 && !emulator.ptr_eq(&Arc::downgrade(&self.emulator))
        };
        lock(&RUNNING).iter_mut().for_each(|running| running.retain(others));
    }
}

const MEMORY: &str = "memory.bin";
/// Flash sectors of the settings, for a machine without shared memory
/// (`firmware/stm32f4/src/file.rs`).
const FLASH: &str = "flash.bin";
const FLASH_BYTES: usize = 32 << 10;
const LOG: &str = "log.bin";
const LINK: &str = "link";
const ERRORS: &str = "errors.txt";

/// Longest time until the emulator listens.
const STARTING: Duration = Duration::from_secs(20);

/// Checks that the emulator for a machine is installed.
///
/// # Errors
///
/// [`QemuError::NotInstalled`] with the package that has it.
pub fn check_installed(machine: Machine) -> Result<(), QemuError> {
    let program = machine.emulator();
    let path = std::env::var_os("PATH").unwrap_or_default();
    if std::env::split_paths(&path).any(|folder| folder.join(program).is_file()) {
        return Ok(());
    }
    let package = if machine == Machine::Virt { "qemu-system-misc" } else { "qemu-system-arm" };
    Err(QemuError::NotInstalled { program, package })
}

/// Refuses an image for another machine, which the emulator would run without a useful message.
fn check_image(machine: Machine, path: &Path) -> Result<(), QemuError> {
    if !path.is_file() {
        return Err(QemuError::NoImage { path: path.to_owned(), target: machine.target() });
    }
    let bad = |what: String| QemuError::BadImage { path: path.to_owned(), what };
    let bytes = fs::read(path).map_err(io_error("read", path))?;
    let file = object::File::parse(&*bytes).map_err(|_| bad("not an ELF file".into()))?;
    let (architecture, flash) = machine.code();
    let first = file.segments().min_by_key(|segment| segment.address());
    let start = first.as_ref().map(|segment| segment.address());
    if file.architecture() != architecture || start != Some(flash) {
        let start = start.map_or("nowhere".into(), |address| format!("at {address:#x}"));
        return Err(bad(format!(
            "for {:?}, loaded {start}; {} runs {architecture:?} code at {flash:#x} (cargo xtask \
             firmware --target {})",
            file.architecture(),
            machine.name(),
            machine.target()
        )));
    }
    let word = first.and_then(|segment| segment.data_range(flash, 4).ok().flatten());
    let stack = word.and_then(|bytes| bytes.try_into().ok()).map_or(0, u32::from_le_bytes);
    if let Some(expected) = machine.stack().filter(|ram| stack.wrapping_sub(*ram) > 16 << 20) {
        return Err(bad(format!(
            "for another board: its stack begins at {stack:#x}, that of {} within 16 MB of \
             {expected:#x} (cargo xtask firmware --target {})",
            machine.name(),
            machine.target()
        )));
    }
    Ok(())
}

/// Folder of the emulator, in `/dev/shm` where there is one: its RAM should not be written to a
/// disk.
fn folder(options: &QemuOptions) -> Result<(PathBuf, Guard), QemuError> {
    if let Some(folder) = &options.folder {
        guard::make_private_with_parents(folder).map_err(io_error("make", folder))?;
        let guard = Guard::over_emulator().map_err(io_error("guard", folder))?;
        return Ok((folder.clone(), guard));
    }
    let shared = Path::new("/dev/shm");
    let parent = if shared.is_dir() { shared.to_owned() } else { std::env::temp_dir() };
    let guard = Guard::over_new_folder(&parent).map_err(io_error("make a folder in", &parent))?;
    Ok((guard.folder().unwrap_or(&parent).to_owned(), guard))
}

/// Writes an erased flash, unless there is one already.
fn blank_flash(folder: &Path) -> Result<(), QemuError> {
    let path = folder.join(FLASH);
    if fs::metadata(&path).is_ok_and(|file| file.len() == FLASH_BYTES as u64) {
        return Ok(());
    }
    fs::write(&path, [0xFF; FLASH_BYTES]).map_err(io_error("write", &path))
}

fn io_error(verb: &str, path: &Path) -> impl FnOnce(io::Error) -> QemuError {
    let what = format!("{verb} {}", path.display());
    move |source| QemuError::Io { what, source }
}

fn spawn(options: &QemuOptions, folder: &Path, group: i32) -> Result<Child, QemuError> {
    let machine = options.machine;
    // A machine that keeps its settings in a file runs in its folder, so paths must be absolute.
    let absolute = |path: &Path| std::path::absolute(path).map_err(io_error("find", path));
    let (image, own_folder) = (absolute(&options.image)?, absolute(folder)?);
    let at = |name: &str| own_folder.join(name).display().to_string();
    let _ = fs::remove_file(folder.join(LINK)); // left by an earlier run in the same folder
    let errors = File::create(folder.join(ERRORS)).map_err(io_error("write in", folder))?;
    let mut command = Command::new(machine.emulator());
    if let Some((bytes, _)) = machine.memory() {
        let memory = at(MEMORY);
        command
            .args(["-M", &format!("{},memory-backend=shared", machine.name())])
            .args(["-m", &format!("{}M", bytes >> 20)])
            .arg("-object")
            .arg(format!("memory-backend-file,id=shared,size={bytes},mem-path={memory},share=on"));
    } else {
        // The image reads and writes its settings by semihosting, in this folder.
        command.args(["-M", machine.name(), "-semihosting-config", "enable=on,target=native"]);
        command.current_dir(folder);
    }
    command
        .args(["-display", "none", "-monitor", "none", "-nodefaults"])
        .args([
            "-chardev",
            &format!("socket,id=link,path={},server=on,wait=on", at(LINK)),
            "-serial",
            "chardev:link",
        ])
        .args(["-serial", &format!("file:{}", at(LOG))])
        .args(&options.arguments)
        .arg("-kernel")
        .arg(image);
    if machine == Machine::Virt {
        command.args(["-bios", "none"]);
    }
    // In the guard's group, so that ^C reaches this program alone, which then ends the emulator.
    command.stdin(Stdio::null()).stdout(Stdio::null()).stderr(errors).process_group(group);
    command.spawn().map_err(io_error("run", Path::new(machine.emulator())))
}

fn connect(
    emulator: &Mutex<Emulator>,
    machine: Machine,
    folder: &Path,
) -> Result<UnixStream, QemuError> {
    let deadline = Instant::now() + STARTING;
    let failed = |what| QemuError::Failed { machine: machine.name(), what };
    loop {
        if let Ok(link) = UnixStream::connect(folder.join(LINK)) {
            link.set_nonblocking(true).map_err(io_error("use", &folder.join(LINK)))?;
            return Ok(link);
        }
        if let Some(what) = failure(emulator, machine, folder) {
            return Err(failed(what));
        }
        if Instant::now() > deadline {
            return Err(failed(format!("did not listen within {STARTING:?}")));
        }
        thread::sleep(Duration::from_millis(2));
    }
}

/// Exit status of the emulator, if it has ended, and the first line of its errors: a dump of
/// registers may follow.
fn failure(emulator: &Mutex<Emulator>, machine: Machine, folder: &Path) -> Option<String> {
    let status = lock(emulator).child.try_wait().ok()??;
    let said = fs::read_to_string(folder.join(ERRORS)).unwrap_or_default();
    let said = one_line(said.trim().lines().next().unwrap_or_default());
    Some(format!(
        "{} ended ({status}){}{said}",
        machine.emulator(),
        if said.is_empty() { "" } else { ": " }
    ))
}

/// Waiting that gets longer each time: a doorbell is answered in a microsecond, and an idle link
/// takes no processor time.
#[derive(Default)]
struct Idle(u32);

impl Idle {
    fn wait(&mut self) {
        self.0 += 1;
        match self.0 {
            0..200 => std::hint::spin_loop(),
            200..2_000 => thread::yield_now(),
            _ => thread::sleep(Duration::from_micros(50)),
        }
    }
}

/// Mailbox in shared memory.
struct Page {
    memory: MmapRaw,
}

impl Page {
    fn make(
        (bytes, offset): (u64, u64),
        path: &Path,
        straps: &[u32; mailbox::STRAP_WORDS],
    ) -> Result<Self, QemuError> {
        let open = || -> io::Result<MmapRaw> {
            let file = OpenOptions::new()
                .read(true)
                .write(true)
                .create(true)
                .truncate(false)
                .open(path)?;
            if file.metadata()?.len() != bytes {
                file.set_len(0)?;
                file.set_len(bytes)?;
            }
            MmapOptions::new().offset(offset).len(mailbox::BYTES).map_raw(&file)
        };
        let page = Self { memory: open().map_err(io_error("map", path))? };
        for (word, &strap) in straps.iter().enumerate() {
            page.write(mailbox::STRAPS + 4 * word, strap);
        }
        let blank = (mailbox::EMITTER..mailbox::ADC + 4 * mailbox::REGISTERS).step_by(4);
        for offset in [mailbox::DOORBELL, mailbox::ANSWER, mailbox::RUN].into_iter().chain(blank) {
            page.write(offset, 0);
        }
        page.write(mailbox::EMITTER, emitter::ID_VALUE);
        page.write(mailbox::ADC, adc::ID_VALUE);
        page.write(0, mailbox::MAGIC);
        Ok(page)
    }

    fn words(&self) -> &[AtomicU32] {
        // SAFETY: the mapping is as long as the mailbox, page aligned, lives as long as `self`, and
        // is only ever accessed as atomic words here; the other side is another process.
        unsafe {
            std::slice::from_raw_parts(self.memory.as_ptr().cast::<AtomicU32>(), mailbox::BYTES / 4)
        }
    }

    fn read(&self, offset: usize) -> u32 {
        u32::from_le(self.words()[offset / 4].load(Ordering::Acquire))
    }

    fn write(&self, offset: usize, value: u32) {
        self.words()[offset / 4].store(value.to_le(), Ordering::Release);
    }

    fn write_codes(&self, codes: &[u16]) {
        let words = &self.words()[mailbox::CODES / 4..];
        for (word, pair) in words.iter().zip(codes.chunks(2)) {
            let high = pair.get(1).copied().unwrap_or(0);
            word.store((u32::from(pair[0]) | u32::from(high) << 16).to_le(), Ordering::Relaxed);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_machine_is_found_by_its_name_and_no_other_is() {
        for machine in Machine::ALL {
            assert_eq!(Machine::from_name(machine.name()), Some(machine));
        }
        assert_eq!(Machine::from_name("mps2-an999"), None);
    }

    #[test]
    fn samples_lie_in_the_buffer_as_the_sensor_reads_them() {
        let folder = tempfile::tempdir().unwrap();
        let place = Machine::Virt.memory().unwrap();
        let page = Page::make(place, &folder.path().join("m"), &[1; mailbox::STRAP_WORDS]).unwrap();
        page.write_codes(&[1, 2, 3]);
        let bytes = fs::read(folder.path().join("m")).unwrap();
        let buffer = (16 << 20) + mailbox::CODES;
        assert_eq!(bytes[buffer..buffer + 8], [1, 0, 2, 0, 3, 0, 0, 0]);
        assert_eq!(page.read(mailbox::STRAPS + 28), 1);
    }
}
