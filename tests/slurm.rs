//! A real Slurm on this machine alone: an array of shards, one of them requeued, makes the frame of one machine.
//!
//! Needs Debian's `slurm-wlm`, and starts daemons of its own with their own configuration, key and ports; where that is
//! not possible the test says so.

use std::{
    ffi::OsStr,
    net::TcpListener,
    os::unix::fs::PermissionsExt,
    path::{Path, PathBuf},
    process::{Child, Command, Stdio},
    time::{Duration, Instant},
};

use crate::{
    farm::same,
    support::{SWATCH, directory, project, write, yarnray},
};

/// Where a program lies; daemons are in folders that are not in every PATH.
fn find(name: &str) -> Option<PathBuf> {
    let path = std::env::var_os("PATH").unwrap_or_default();
    let folders = std::env::split_paths(&path).chain(["/usr/sbin".into(), "/sbin".into()]);
    folders.map(|f| f.join(name)).find(|p| p.exists())
}

/// Slurm's daemons; they end with it.
struct Slurm {
    directory: PathBuf,
    daemons: Vec<Child>,
}

impl Slurm {
    /// Starts a cluster of this machine, or tells why not.
    fn start(directory: &Path) -> Result<Self, String> {
        let need = |name: &str| find(name).ok_or_else(|| format!("{name} is not installed (Debian: slurm-wlm, munge)"));
        let [munged, controller, node] = [need("munged")?, need("slurmctld")?, need("slurmd")?];
        for tool in ["sbatch", "scontrol", "squeue"] {
            need(tool)?;
        }
        let user = text(Command::new("id").arg("-un"))?;
        let host = text(Command::new("hostname").arg("-s"))?;
        let munge = directory.join("munge");
        for folder in [&munge, &directory.join("state"), &directory.join("spool")] {
            std::fs::create_dir(folder).map_err(|e| e.to_string())?;
            let _ = std::fs::set_permissions(folder, PermissionsExt::from_mode(0o755));
        }
        let key = munge.join("key");
        std::fs::write(&key, [7; 128]).map_err(|e| e.to_string())?;
        let _ = std::fs::set_permissions(&key, PermissionsExt::from_mode(0o600));
        // Ports that are free now.
        let ports: Vec<TcpListener> =
            (0..2).map(|_| TcpListener::bind("127.0.0.1:0")).collect::<Result<_, _>>().map_err(|e| e.to_string())?;
        let [a, b] = [0, 1].map(|i| ports[i].local_addr().map_or(0, |address| address.port()));
        drop(ports);
        let d = directory.display();
        let conf = format!(
            "ClusterName=yarnray\nSlurmctldHost={host}(127.0.0.1)\nSlurmUser={user}\nSlurmdUser={user}\n\
             AuthType=auth/munge\nAuthInfo=socket={d}/munge/socket\nCredType=cred/munge\n\
             SlurmctldPort={a}\nSlurmdPort={b}\nStateSaveLocation={d}/state\nSlurmdSpoolDir={d}/spool\n\
             SlurmctldPidFile={d}/slurmctld.pid\nSlurmdPidFile={d}/slurmd.pid\n\
             SlurmctldLogFile={d}/slurmctld.log\nSlurmdLogFile={d}/slurmd.log\n\
             ProctrackType=proctrack/linuxproc\nTaskPlugin=task/none\nSwitchType=switch/none\nMpiDefault=none\n\
             SelectType=select/cons_tres\nSelectTypeParameters=CR_CPU\nSlurmdParameters=config_overrides\n\
             SchedulerParameters=sched_interval=1,sched_min_interval=0,batch_sched_delay=0\n\
             JobRequeue=1\nKillWait=20\nReturnToService=2\nMailProg=/bin/true\n\
             NodeName={host} NodeAddr=127.0.0.1 CPUs=4 RealMemory=500 State=UNKNOWN\n\
             PartitionName=test Nodes=ALL Default=YES MaxTime=INFINITE State=UP\n"
        );
        std::fs::write(directory.join("slurm.conf"), conf).map_err(|e| e.to_string())?;
        let mut slurm = Self { directory: directory.to_owned(), daemons: Vec::new() };
        let m = |name: &str| munge.join(name).display().to_string();
        slurm.daemon(
            &munged,
            &[
                "--foreground".to_owned(),
                "--force".to_owned(),
                format!("--key-file={}", m("key")),
                format!("--socket={}", m("socket")),
                format!("--pid-file={}", m("pid")),
                format!("--log-file={}", m("log")),
                format!("--seed-file={}", m("seed")),
            ],
        )?;
        slurm.until("munged does not start", 10, |_| munge.join("socket").exists())?;
        slurm.daemon(&controller, &["-D".to_owned()])?;
        slurm.daemon(&node, &["-D".to_owned(), "-N".to_owned(), host])?;
        slurm.until("no node becomes idle", 20, |s| {
            s.tool("sinfo", &["-h", "-o", "%t"]).is_ok_and(|state| state.starts_with("idle"))
        })?;
        Ok(slurm)
    }

    fn daemon(&mut self, program: &Path, args: &[String]) -> Result<(), String> {
        let mut command = self.command(program);
        let child = command.args(args).stdout(Stdio::null()).stderr(Stdio::null()).spawn();
        self.daemons.push(child.map_err(|e| format!("{}: {e}", program.display()))?);
        Ok(())
    }

    fn command(&self, program: impl AsRef<OsStr>) -> Command {
        let mut command = Command::new(program);
        command.env("SLURM_CONF", self.directory.join("slurm.conf")).current_dir(&self.directory);
        command.env("YARNRAY", env!("CARGO_BIN_EXE_yarnray")).stdin(Stdio::null());
        command
    }

    /// What a tool prints.
    fn tool(&self, name: impl AsRef<OsStr>, args: &[&str]) -> Result<String, String> {
        text(self.command(name).args(args))
    }

    fn until(&self, problem: &str, seconds: u64, ready: impl Fn(&Self) -> bool) -> Result<(), String> {
        let end = Instant::now() + Duration::from_secs(seconds);
        while !ready(self) {
            if Instant::now() > end {
                return Err(format!("{problem} within {seconds} s"));
            }
            std::thread::sleep(Duration::from_millis(50));
        }
        Ok(())
    }
}

impl Drop for Slurm {
    fn drop(&mut self) {
        // The node first, then its controller, then the keys.
        for daemon in self.daemons.iter_mut().rev() {
            let _ = daemon.kill();
            let _ = daemon.wait();
        }
    }
}

fn text(command: &mut Command) -> Result<String, String> {
    let output = command.output().map_err(|e| e.to_string())?;
    if !output.status.success() {
        return Err(String::from_utf8_lossy(&output.stderr).into_owned());
    }
    Ok(String::from_utf8_lossy(&output.stdout).trim().to_owned())
}

#[test]
fn a_requeued_array_of_shards_makes_the_frame_of_one_machine() {
    let directory = directory();
    let d = directory.path();
    let slurm = match Slurm::start(d) {
        Ok(slurm) => slurm,
        Err(problem) => {
            crate::support::skipped(&format!("Slurm cannot start here: {problem}"));
            return;
        }
    };
    write(d, "s.toml", SWATCH);
    let options = ["--spp", "4000", "--crop", "10,10,30,22"];
    let submit = project("tools/slurm/submit");
    let args = [&["3", "s.toml", "frame.exr"], &options[..], &["--checkpoint-every", "0.2"]].concat();
    let merge = slurm.tool(submit, &args).expect("the jobs are accepted");
    let log = || {
        let logs = ["1.log", "2.log", "3.log", "merge.log"].map(|n| d.join("frame.exr.parts").join(n));
        logs.map(|l| std::fs::read_to_string(l).unwrap_or_default()).join("\n")
    };
    // As soon as the second shard has saved something, it loses its place, as if it were pre-empted.
    let film = d.join("frame.exr.parts/2.film");
    slurm.until("no checkpoint", 60, |_| film.exists()).unwrap_or_else(|e| panic!("{e}\n{}", log()));
    let array = merge.parse::<u32>().expect("the number of a job") - 1;
    // The merge job's number follows the array's, whose tasks but the last have further numbers.
    let array = slurm
        .tool("squeue", &["-h", "-a", "-o", "%F", "-n", "yarnray"])
        .ok()
        .and_then(|lines| lines.lines().next()?.parse().ok())
        .unwrap_or(array);
    let task = format!("{array}_2");
    slurm.tool("scontrol", &["requeue", &task]).unwrap_or_else(|e| panic!("the shard is over already: {e}\n{}", log()));
    // Slurm would let it wait for two minutes; it takes some, for a node refuses what it killed within the same second.
    std::thread::sleep(Duration::from_secs(3));
    let out = d.join("frame.exr");
    slurm
        .until("no frame", 90, |s| {
            let _ = s.tool("scontrol", &["update", &format!("jobid={task}"), "StartTime=now"]);
            out.exists()
        })
        .unwrap_or_else(|e| {
            let jobs = slurm.tool("scontrol", &["show", "jobs"]).unwrap_or_default();
            let node = std::fs::read_to_string(d.join("slurmd.log")).unwrap_or_default();
            panic!("{e}\n{jobs}\n{node}\n{}", log())
        });
    let said = std::fs::read_to_string(d.join("frame.exr.parts/2.log")).unwrap_or_default();
    assert!(said.contains("resumed from"), "the shard was started twice: {said}");
    yarnray(d, &[&["render", "s.toml", "-q", "-o", "want.exr"], &options[..]].concat()).good();
    same(d, "want.exr", "frame.exr");
}
