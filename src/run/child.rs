//! One running job process as its parent sees it: started, listened to, measured, ended.

use super::event::Progress;
use super::pool::Program;
use super::protocol::{Message, Request};
use super::provenance;
use std::io::{BufRead, BufReader, Read, Write};
use std::process::{Child, Command, ExitStatus, Stdio};
use std::sync::mpsc::Sender;
use std::time::{Duration, Instant};

/// After the soft limit, which the process itself keeps between two iterations, the process is killed: then, or a
/// fiftieth of the limit later, for those of long limits have long iterations.
pub(super) const GRACE: Duration = Duration::from_secs(1);
const SHARE_OF_LIMIT: u32 = 50;
/// The phase in which a method measures what it has, also after the soft limit: a result that is there is not thrown
/// away.
const MEASURING: &str = "measure";
/// It takes a quarter of the limit at most, or this.
const LEAST_FOR_MEASURING: Duration = Duration::from_secs(10);
/// After its end, what a process has left in its pipes is waited for; a grandchild could hold them open for ever.
const PIPES: Duration = Duration::from_millis(500);
/// What is kept of standard error.
const TAIL: usize = 4096;

/// What a process's readers pass on, with the process's number in the pool.
pub(super) enum Heard {
    Message(Message),
    /// A line that is no message.
    Noise(String),
    /// Standard output is at its end.
    EndOfMessages,
    /// Standard error is at its end: its last bytes.
    Errors(String),
}

/// Why the parent killed a process.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Killed {
    TimeLimit,
    MemoryLimit { used: u64 },
    Interrupted,
}

pub(super) struct Running {
    child: Child,
    pub(super) started: Instant,
    /// When the process is killed for its time.
    deadline: Option<Instant>,
    limit: Option<Duration>,
    memory: Option<u64>,
    pub(super) killed: Option<Killed>,
    /// Highest resident memory seen from outside.
    pub(super) peak_memory: u64,
    pub(super) phase: Option<String>,
    pub(super) progress: Option<Progress>,
    pub(super) last: Option<Message>,
    pub(super) noise: String,
    pub(super) errors: String,
    open_pipes: u8,
    exited: Option<(ExitStatus, Instant)>,
}

impl Running {
    /// Starts a process and hands it its request. `number` tells its messages from those of others.
    pub(super) fn start(
        program: &Program,
        request: &Request,
        number: usize,
        sender: &Sender<(usize, Heard)>,
    ) -> std::io::Result<Self> {
        let question = serde_json::to_vec(request)?;
        let mut child = Command::new(&program.path)
            .args(&program.arguments)
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .stderr(Stdio::piped())
            .spawn()?;
        let (input, output, errors) = (child.stdin.take(), child.stdout.take(), child.stderr.take());
        let listener = sender.clone();
        std::thread::spawn(move || {
            if let Some(output) = output {
                for line in BufReader::new(output).split(b'\n') {
                    let Ok(line) = line else { break };
                    let heard = match serde_json::from_slice(&line) {
                        Ok(message) => Heard::Message(message),
                        Err(_) => Heard::Noise(String::from_utf8_lossy(&line).trim().to_string()),
                    };
                    let _ = listener.send((number, heard));
                }
            }
            let _ = listener.send((number, Heard::EndOfMessages));
        });
        let listener = sender.clone();
        std::thread::spawn(move || {
            if let Some(mut input) = input {
                // A process that ends without reading shows in its exit status.
                let _ = input.write_all(&question);
            }
            let mut tail = Vec::new();
            if let Some(mut errors) = errors {
                let mut buffer = [0; TAIL];
                while let Ok(count @ 1..) = errors.read(&mut buffer) {
                    tail.extend_from_slice(&buffer[..count]);
                    tail.drain(..tail.len().saturating_sub(TAIL));
                }
            }
            let text = String::from_utf8_lossy(&tail).trim().to_string();
            let _ = listener.send((number, Heard::Errors(text)));
        });
        let limit = request
            .seconds
            .and_then(|seconds| Duration::try_from_secs_f64(seconds).ok());
        let mut running = Running {
            child,
            started: Instant::now(),
            deadline: None,
            limit,
            memory: request.memory,
            killed: None,
            peak_memory: 0,
            phase: None,
            progress: None,
            last: None,
            noise: String::new(),
            errors: String::new(),
            open_pipes: 2,
            exited: None,
        };
        running.start_clock();
        Ok(running)
    }

    /// The time limit counts from now.
    fn start_clock(&mut self) {
        self.started = Instant::now();
        self.deadline = self.limit.and_then(|limit| {
            self.started
                .checked_add(limit)?
                .checked_add(GRACE.max(limit / SHARE_OF_LIMIT))
        });
    }

    /// Takes note of what was heard.
    pub(super) fn hear(&mut self, heard: Heard) {
        match heard {
            Heard::Message(message) => match message {
                Message::Waiting(_) => self.deadline = None,
                Message::Repetition(_) => self.start_clock(),
                Message::Phase(phase) => {
                    if phase == MEASURING && self.phase.as_deref() != Some(MEASURING) {
                        let more = self.limit.map(|limit| (limit / 4).max(LEAST_FOR_MEASURING));
                        self.deadline = self
                            .deadline
                            .zip(more)
                            .and_then(|(deadline, more)| deadline.checked_add(more));
                    }
                    self.phase = Some(phase);
                }
                Message::Iterate(progress) => self.progress = Some(progress),
                Message::Warning(_) => {}
                Message::Busy | Message::Finished { .. } | Message::Cancelled => {
                    // It only has to end now.
                    self.last = Some(message);
                    self.deadline = Instant::now().checked_add(GRACE);
                }
            },
            Heard::Noise(line) => self.noise = line,
            Heard::EndOfMessages => self.open_pipes -= 1,
            Heard::Errors(text) => {
                self.errors = text;
                self.open_pipes -= 1;
            }
        }
    }

    /// Looks at time, memory and life of the process; the status when it is over and everything was heard.
    pub(super) fn look(&mut self) -> Option<ExitStatus> {
        if self.exited.is_none() {
            match self.child.try_wait() {
                Ok(Some(status)) => self.exited = Some((status, Instant::now())),
                Ok(None) => self.enforce(),
                Err(_) => self.kill(Killed::Interrupted),
            }
        }
        let (status, at) = self.exited?;
        (self.open_pipes == 0 || at.elapsed() > PIPES).then_some(status)
    }

    fn enforce(&mut self) {
        if let Some(used) = provenance::resident_memory(self.child.id()) {
            self.peak_memory = self.peak_memory.max(used);
            if self.memory.is_some_and(|limit| used > limit) {
                self.kill(Killed::MemoryLimit { used });
            }
        }
        if self.deadline.is_some_and(|deadline| Instant::now() >= deadline) {
            self.kill(Killed::TimeLimit);
        }
    }

    /// Whether memory has to be watched closely.
    pub(super) fn is_memory_limited(&self) -> bool {
        self.memory.is_some()
    }

    /// Asks the process to stop.
    pub(super) fn terminate(&self) {
        if self.exited.is_none() {
            let process = rustix::process::Pid::from_child(&self.child);
            let _ = rustix::process::kill_process(process, rustix::process::Signal::TERM);
        }
    }

    /// Ends the process at once; the first reason counts.
    pub(super) fn kill(&mut self, reason: Killed) {
        if self.exited.is_none() {
            self.killed.get_or_insert(reason);
            let _ = self.child.kill();
        }
    }
}

impl Drop for Running {
    /// No process is left behind, on whatever way the pool ends.
    fn drop(&mut self) {
        if self.exited.is_none() {
            let _ = self.child.kill();
            let _ = self.child.wait();
        }
    }
}
