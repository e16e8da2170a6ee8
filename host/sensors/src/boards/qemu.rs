//! The sensor's image in QEMU: the program of a microcontroller, its serial link, and the analog
//! world in shared memory.
//!
//! The emulator maps a file as the board's PSRAM; [`mailbox`] says what lies there. This side plays
//! the world: when the sensor rings for a shot, the front end's samples go into the converter's
//! buffer. It does so while it waits for the sensor's answer, in the caller's thread, so that
//! nothing runs behind its back.

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
use echoloop_files::shown;
use echoloop_sensor::afe::{adc, emitter};
use echoloop_sensor::mailbox;
use memmap2::{MmapOptions, MmapRaw};
use object::{Architecture, Object, ObjectSegment};
use thiserror::Error;

use crate::boards::pc::{read_analog, read_noise, read_trigger};
use echoloop_frontend::FrontEnd;
use guard::Guard;

/// Boards that QEMU emulates and there is an image for.
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
    /// All of them, the reference board first.
    pub const ALL: [Self; 7] = [
        Self::An386,
        Self::An500,
        Self::An505,
        Self::An547,
        Self::An385,
        Self::Virt,
        Self::NetduinoPlus2,
    ];

    /// Whether it has a front end, in memory. One that has none takes waveforms over its link.
    pub const fn has_front_end(self) -> bool {
        self.memory().is_some()
    }

    /// QEMU's name for it.
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

    /// The machine of a name.
    pub fn from_name(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|machine| machine.name() == name)
    }

    /// What its image is built for: `cargo xtask firmware --target` has it.
    pub const fn target(self) -> &'static str {
        match self {
            Self::An385 => "thumbv6m-none-eabi",
            Self::An386 | Self::An500 | Self::NetduinoPlus2 => "thumbv7em-none-eabihf",
            Self::An505 => "thumbv8m.main-none-eabihf",
            Self::An547 => "cortex-m55",
            Self::Virt => "riscv32imac-unknown-none-elf",
        }
    }

    /// The emulator's program.
    pub const fn emulator(self) -> &'static str {
        match self {
            Self::Virt => "qemu-system-riscv32",
            _ => "qemu-system-arm",
        }
    }

    /// Where `cargo xtask firmware` puts its image, below the workspace's root.
    pub fn image(self) -> PathBuf {
        let program = match self {
            Self::NetduinoPlus2 => "firmware/echoloop-stm32f405",
            _ => "firmware/echoloop-sensor",
        };
        let folder = match self {
            // No target of the compiler.
            Self::An547 => "cortex-m55/thumbv8m.main-none-eabihf",
            _ => self.target(),
        };
        Path::new("target/firmware").join(folder).join(program)
    }

    /// What its processor's ELF files say, and where its flash begins.
    const fn code(self) -> (Architecture, u64) {
        match self {
            Self::An385 | Self::An386 | Self::An500 => (Architecture::Arm, 0),
            Self::An505 | Self::An547 => (Architecture::Arm, 0x1000_0000),
            Self::Virt => (Architecture::Riscv32, 0x8000_0000),
            Self::NetduinoPlus2 => (Architecture::Arm, 0x0800_0000),
        }
    }

    /// Where the stack of its images begins, the first word of an Arm's flash: somewhere in these
    /// 16 MB. It tells boards apart whose flash begins at the same place.
    const fn stack(self) -> Option<u32> {
        match self {
            Self::An505 => Some(0x3800_0000),
            Self::An547 => Some(0x3000_0000),
            _ => None,
        }
    }

    /// Bytes of the shared memory, and where in it the mailbox begins; `None` where there is no
    /// such memory, and so no front end.
    const fn memory(self) -> Option<(u64, u64)> {
        match self {
            Self::Virt => Some((32 << 20, 16 << 20)), // all of its RAM
            Self::An547 => Some((2 << 30, 0)),        // all of its DDR4, of which little is touched
            Self::NetduinoPlus2 => None,
            _ => Some((16 << 20, 0)),
        }
    }
}

/// Why there is no emulated sensor.
#[derive(Debug, Error)]
pub enum QemuError {
    /// The emulator is not installed.
    #[error("{program} is not on the PATH (Debian: apt-get install {package})")]
    NotInstalled {
        /// Its program.
        program: &'static str,
        /// Debian's package.
        package: &'static str,
    },
    /// There is no image.
    #[error("no image {}: build it with `cargo xtask firmware --target {target}`", path.display())]
    NoImage {
        /// Where it was looked for.
        path: PathBuf,
        /// The target it is built for.
        target: &'static str,
    },
    /// The image is not one for the machine.
    #[error("{}: {what}", path.display())]
    BadImage {
        /// The file.
        path: PathBuf,
        /// What is wrong with it.
        what: String,
    },
    /// The emulator ended or did not start in time.
    #[error("{machine} in QEMU: {what}")]
    Failed {
        /// The machine.
        machine: &'static str,
        /// What happened, with what it said.
        what: String,
    },
    /// Memory or folder could not be had.
    #[error("cannot {what}: {source}")]
    Io {
        /// What was tried.
        what: String,
        /// Why not.
        source: io::Error,
    },
}

/// What to emulate.
#[derive(Clone, Debug)]
pub struct QemuOptions {
    /// The machine.
    pub machine: Machine,
    /// The image, an ELF file.
    pub image: PathBuf,
    /// Where memory, log and socket lie: kept, so that the sensor finds its flash again. `None`: a
    /// new folder that goes away.
    pub folder: Option<PathBuf>,
    /// More arguments for the emulator.
    pub arguments: Vec<String>,
}

impl QemuOptions {
    /// A machine with the image that `cargo xtask firmware` has built below `workspace`.
    pub fn new(machine: Machine, workspace: &Path) -> Self {
        Self {
            machine,
            image: workspace.join(machine.image()),
            folder: None,
            arguments: Vec::new(),
        }
    }
}

/// A sensor in QEMU: bytes in, bytes out.
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

/// The process, and who ends it and removes its folder should this process be killed.
struct Emulator {
    child: Child,
    guard: Option<Guard>,
}

impl Emulator {
    /// Locked until it is listed, so that [`stop_all`] finds every one that was started.
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

/// Emulators of this process, for [`stop_all`]; `None` once they were stopped for good.
static RUNNING: Mutex<Option<Vec<Weak<Mutex<Emulator>>>>> = Mutex::new(Some(Vec::new()));

/// Ends every emulator of this process, removes their folders, and lets no other start: for those
/// who are about to exit without dropping anything. Whoever calls second waits for the first.
pub fn stop_all() {
    let mut running = lock(&RUNNING);
    let emulators = running.take().into_iter().flatten();
    emulators.filter_map(|emulator| emulator.upgrade()).for_each(|emulator| lock(&emulator).stop());
}

fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

impl<F: FrontEnd> Qemu<F> {
    /// Switches a sensor on. `hardware.adc_bits` is taken from the front end. A machine without a
    /// front end in memory has hardware and pattern of its own, and takes none of the three.
    ///
    /// # Errors
    ///
    /// [`QemuError`].
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

    /// The front end, to look at another scene with.
    pub fn front_end_mut(&mut self) -> &mut F {
        &mut self.front_end
    }

    /// The machine.
    pub fn machine(&self) -> Machine {
        self.machine
    }

    /// The log's bytes so far: defmt's frames.
    pub fn log_file(&self) -> PathBuf {
        self.folder.join(LOG)
    }

    /// Sends bytes to the sensor.
    ///
    /// # Errors
    ///
    /// When the emulator has ended, or takes nothing for seconds.
    pub fn send(&mut self, mut bytes: &[u8]) -> io::Result<()> {
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

    /// Receives some bytes, serving shots meanwhile; none when the time is up.
    ///
    /// # Errors
    ///
    /// When the emulator has ended.
    pub fn receive(&mut self, buffer: &mut [u8], timeout: Duration) -> io::Result<usize> {
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

    /// Answers the doorbell. False: nobody rang.
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
        self.front_end.capture(&analog, read_trigger(&emitter), &mut self.codes[..samples]);
        page.write_codes(&self.codes[..samples]);
        self.shots = shots;
        page.write(mailbox::ANSWER, shots);
        true
    }

    /// Why the line broke, if the emulator knows.
    fn ended(&mut self, error: io::Error) -> io::Error {
        // Its socket closes before it has ended.
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

impl<F> Qemu<F> {
    /// The folder with memory, log and sockets.
    pub fn folder(&self) -> &Path {
        &self.folder
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
/// The settings' sectors of a machine without shared memory: `firmware/stm32f4/src/file.rs`.
const FLASH: &str = "flash.bin";
const FLASH_BYTES: usize = 32 << 10;
const LOG: &str = "log.bin";
const LINK: &str = "link";
const ERRORS: &str = "errors.txt";

/// How long the emulator may take to listen.
const STARTING: Duration = Duration::from_secs(20);

/// Whether the emulator for a machine is there.
///
/// # Errors
///
/// [`QemuError::NotInstalled`] with the package that brings it.
pub fn check_installed(machine: Machine) -> Result<(), QemuError> {
    let program = machine.emulator();
    let path = std::env::var_os("PATH").unwrap_or_default();
    if std::env::split_paths(&path).any(|folder| folder.join(program).is_file()) {
        return Ok(());
    }
    let package = if machine == Machine::Virt { "qemu-system-misc" } else { "qemu-system-arm" };
    Err(QemuError::NotInstalled { program, package })
}

/// The emulator runs anything, and what it says of what is no program is no help.
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

/// In memory where there is such a place: the emulator's RAM should not be written to a disk.
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

/// A flash in which nothing was ever saved, where there is none.
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
    // An emulator whose settings are a file runs in its folder.
    let absolute = |path: &Path| std::path::absolute(path).map_err(io_error("find", path));
    let (image, own_folder) = (absolute(&options.image)?, absolute(folder)?);
    let at = |name: &str| own_folder.join(name).display().to_string();
    let _ = fs::remove_file(folder.join(LINK)); // of an earlier run in the same folder
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
        // Its settings are a file.
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
    // The guard's group: a ^C in the terminal is for this program, which then ends the emulator.
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

/// Says how the emulator ended, if it has, and its first line: a dump of registers may follow.
fn failure(emulator: &Mutex<Emulator>, machine: Machine, folder: &Path) -> Option<String> {
    let status = lock(emulator).child.try_wait().ok()??;
    let said = fs::read_to_string(folder.join(ERRORS)).unwrap_or_default();
    let said = shown(said.trim().lines().next().unwrap_or_default());
    Some(format!(
        "{} ended ({status}){}{said}",
        machine.emulator(),
        if said.is_empty() { "" } else { ": " }
    ))
}

fn may_go_on(error: &io::Error) -> bool {
    matches!(error.kind(), io::ErrorKind::WouldBlock | io::ErrorKind::Interrupted)
}

/// Waits a little longer each time: a doorbell is answered in a microsecond, an idle link costs
/// nothing.
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

/// The mailbox, as this side sees it.
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
