//! Client of QEMU's gdb socket: stops a processor, reads and writes its memory, lets it run.

use std::fmt::Write as _;
use std::io::{self, Read, Write};
use std::os::unix::net::UnixStream;
use std::path::Path;
use std::time::{Duration, Instant};

/// Number of the register.
const PROGRAM_COUNTER: u8 = 15;

/// A debugger; connecting stops the processor.
pub struct Gdb(UnixStream);

impl Gdb {
    /// Arguments with which the emulator opens the socket.
    pub fn arguments(socket: &Path) -> [String; 2] {
        ["-gdb".into(), format!("unix:{},server=on,wait=off", socket.display())]
    }

    /// Connects, which stops the processor.
    ///
    /// # Errors
    ///
    /// When the socket does not open within ten seconds.
    pub fn connect(socket: &Path) -> io::Result<Self> {
        let deadline = Instant::now() + Duration::from_secs(10);
        let stream = loop {
            match UnixStream::connect(socket) {
                Err(_) if Instant::now() < deadline => std::thread::sleep(Duration::from_millis(5)),
                connected => break connected?,
            }
        };
        stream.set_read_timeout(Some(Duration::from_secs(10)))?;
        let mut gdb = Self(stream);
        gdb.ask("?")?;
        // Without this question, single registers cannot be set.
        gdb.ask("qXfer:features:read:target.xml:0,ff0")?;
        Ok(gdb)
    }

    /// Reads memory.
    ///
    /// # Errors
    ///
    /// When the emulator refuses.
    pub fn read(&mut self, address: u32, length: usize) -> io::Result<Vec<u8>> {
        let mut memory = Vec::with_capacity(length);
        while memory.len() < length {
            let part = (length - memory.len()).min(1024);
            let hex = self.ask(&format!("m{:x},{part:x}", address as usize + memory.len()))?;
            let bytes = (0..hex.len() / 2).map(|i| u8::from_str_radix(&hex[2 * i..2 * i + 2], 16));
            memory.extend(bytes.collect::<Result<Vec<u8>, _>>().map_err(io::Error::other)?);
        }
        Ok(memory)
    }

    /// Fills memory.
    ///
    /// # Errors
    ///
    /// When the emulator refuses.
    pub fn fill(&mut self, address: u32, length: usize, byte: u8) -> io::Result<()> {
        self.write(address, &vec![byte; length])
    }

    /// Writes memory.
    ///
    /// # Errors
    ///
    /// When the emulator refuses.
    pub fn write(&mut self, address: u32, bytes: &[u8]) -> io::Result<()> {
        for (at, part) in (address as usize..).step_by(1024).zip(bytes.chunks(1024)) {
            let hex = part.iter().fold(String::new(), |mut hex, byte| {
                let _ = write!(hex, "{byte:02x}");
                hex
            });
            let answer = self.ask(&format!("M{at:x},{:x}:{hex}", part.len()))?;
            if answer != "OK" {
                return Err(io::Error::other(format!("memory at {at:#x}: {answer}")));
            }
        }
        Ok(())
    }

    /// Sets the program counter.
    ///
    /// # Errors
    ///
    /// When the emulator refuses.
    pub fn jump(&mut self, address: u32) -> io::Result<()> {
        let little_endian: String =
            address.to_le_bytes().iter().map(|byte| format!("{byte:02x}")).collect();
        match self.ask(&format!("P{PROGRAM_COUNTER:x}={little_endian}"))?.as_str() {
            "OK" => Ok(()),
            answer => Err(io::Error::other(format!("jump to {address:#x}: {answer}"))),
        }
    }

    /// Lets the processor run to an address; `meanwhile` is called while it runs.
    ///
    /// # Errors
    ///
    /// When the emulator refuses, or the address is not reached in ten seconds.
    pub fn run_to(&mut self, address: u32, meanwhile: impl FnOnce()) -> io::Result<()> {
        self.run_until(&format!("0,{address:x},2"), meanwhile)
    }

    /// Lets the processor run until it has written the word at an address.
    ///
    /// # Errors
    ///
    /// When the emulator refuses, or the word is not written in ten seconds.
    pub fn run_to_write(&mut self, address: u32) -> io::Result<()> {
        self.run_until(&format!("2,{address:x},4"), || {})?;
        self.send("s")?; // the watchpoint stops before the instruction that writes
        self.wait()
    }

    /// Runs to a breakpoint, given as "kind,address,length".
    fn run_until(&mut self, breakpoint: &str, meanwhile: impl FnOnce()) -> io::Result<()> {
        self.breakpoint('Z', breakpoint)?;
        self.send("c")?;
        meanwhile();
        self.wait()?;
        self.breakpoint('z', breakpoint)
    }

    /// Waits for the report that the processor has stopped.
    fn wait(&mut self) -> io::Result<()> {
        while !self.packet()?.starts_with('T') {}
        Ok(())
    }

    /// Sets a breakpoint (`Z`) or removes it (`z`).
    fn breakpoint(&mut self, set: char, breakpoint: &str) -> io::Result<()> {
        match self.ask(&format!("{set}{breakpoint}"))?.as_str() {
            "OK" => Ok(()),
            answer => Err(io::Error::other(format!("{set}{breakpoint}: {answer}"))),
        }
    }

    /// Reads the program counter.
    ///
    /// # Errors
    ///
    /// When the emulator refuses.
    pub fn program_counter(&mut self) -> io::Result<u32> {
        let hex = self.ask(&format!("p{PROGRAM_COUNTER:x}"))?;
        u32::from_str_radix(&hex, 16).map(u32::swap_bytes).map_err(io::Error::other)
    }

    /// Disconnects and lets the processor run.
    ///
    /// # Errors
    ///
    /// When the emulator has ended.
    pub fn detach(mut self) -> io::Result<()> {
        self.ask("D").map(drop)
    }

    fn send(&mut self, command: &str) -> io::Result<()> {
        let sum = command.bytes().fold(0u8, u8::wrapping_add);
        self.0.write_all(format!("${command}#{sum:02x}").as_bytes())
    }

    fn ask(&mut self, command: &str) -> io::Result<String> {
        self.send(command)?;
        loop {
            let answer = self.packet()?;
            // Reports of a stop also come unasked.
            if command == "?" || !answer.starts_with('T') {
                return Ok(answer);
            }
        }
    }

    fn packet(&mut self) -> io::Result<String> {
        let mut text = String::new();
        let mut within = false;
        loop {
            let mut byte = [0];
            self.0.read_exact(&mut byte)?;
            match byte[0] {
                b'$' => within = true,
                b'#' => break,
                other if within => text.push(other.into()),
                _ => {} // an acknowledgement
            }
        }
        self.0.read_exact(&mut [0; 2])?; // the checksum, not needed on a socket
        self.0.write_all(b"+")?;
        Ok(text)
    }
}
