//! Films that are saved on the way and gone on from.

use std::{
    fs::{File, Metadata, TryLockError},
    path::{Path, PathBuf},
    time::Instant,
};

use super::{
    super::Failure,
    options::{Outputs, RenderArgs},
};
use crate::{
    image::ImageError,
    render::{
        Job,
        film_file::{self, About},
    },
    scene::Scene,
};

/// A shard takes its samples, all of them, and leaves a film.
pub(super) fn check_shard(args: &RenderArgs, scene: &Scene, outputs: &Outputs) -> Result<(), Failure> {
    if args.shard.is_none() {
        return Ok(());
    }
    let r = &scene.render;
    let wrong = [("time", r.time.is_some()), ("noise", r.noise.is_some()), ("adaptive", r.adaptive)];
    if let Some((name, _)) = wrong.iter().find(|(_, set)| *set) {
        return Err(Failure::hinted(
            format!(
                "--shard with render.{name}: a shard takes just its samples, or the shards would not make one picture"
            ),
            format!("leave out --{name}; --spp says how many samples all shards take together"),
        ));
    }
    if outputs.films.is_empty() && args.checkpoint.is_none() {
        return Err(Failure::hinted(
            "--shard without a film: pictures of shards cannot be merged",
            "-o PART.film, or --checkpoint PART.film",
        ));
    }
    Ok(())
}

/// Keeps other runs off a checkpoint while this one renders to it.
pub(super) struct Lock {
    path: PathBuf,
    _file: File,
}

impl Lock {
    /// Takes the checkpoint, if one is written and no other run has it. The system gives it back when a run ends, however it
    /// does. Where there are no locks on files nothing is kept off.
    pub(super) fn take(args: &RenderArgs) -> Result<Option<Self>, Failure> {
        let Some(checkpoint) = args.checkpoint.as_deref() else { return Ok(None) };
        let mut path = checkpoint.to_owned().into_os_string();
        path.push(".lock");
        let path = PathBuf::from(path);
        Self::at(path).map_err(|Taken| {
            let problem = format!("another run renders to {}", checkpoint.display());
            Failure::hinted(problem, "wait for it, or give this one a checkpoint of its own")
        })
    }

    fn at(path: PathBuf) -> Result<Option<Self>, Taken> {
        loop {
            let Ok(file) = File::create(&path) else { return Ok(None) };
            match file.try_lock() {
                Err(TryLockError::WouldBlock) => return Err(Taken),
                // Another run has ended since the file was opened, and removed it: this lock keeps nobody off.
                Ok(()) if !leads_to(&path, &file) => {}
                _ => return Ok(Some(Self { path, _file: file })),
            }
        }
    }
}

/// Another run has the lock.
#[derive(Debug)]
struct Taken;

/// Whether a path still is that of an open file.
#[cfg(unix)]
fn leads_to(path: &Path, file: &File) -> bool {
    use std::os::unix::fs::MetadataExt as _;
    let id = |of: Metadata| (of.dev(), of.ino());
    std::fs::metadata(path).map(id).ok() == file.metadata().map(id).ok()
}

/// Elsewhere the standard library does not tell.
#[cfg(not(unix))]
fn leads_to(_: &Path, _: &File) -> bool {
    true
}

impl Drop for Lock {
    fn drop(&mut self) {
        // While it is still locked; what cannot be removed is locked by nobody afterwards.
        let _ = std::fs::remove_file(&self.path);
    }
}

/// The checkpoint to go on from, if there is one and it is asked for.
pub(super) fn old_checkpoint(args: &RenderArgs) -> Result<Option<(About, Job)>, Failure> {
    let Some(path) = args.checkpoint.as_deref().filter(|path| path.exists()) else { return Ok(None) };
    if !args.resume {
        let problem = format!("{} is there already", path.display());
        return Err(Failure::hinted(problem, "--resume goes on with it; remove it to begin anew"));
    }
    Ok(Some(film_file::read(path)?))
}

/// The job of a checkpoint, if it is this render's.
pub(super) fn resumed((there, mut job): (About, Job), about: &About, args: &RenderArgs) -> Result<Job, Failure> {
    let path = args.checkpoint.as_deref().unwrap_or(Path::new("")).display();
    let differences = about.differences(&there);
    if !differences.is_empty() {
        let problem = format!("{path} is a checkpoint of another render:\n  {}", differences.join("\n  "));
        return Err(Failure::hinted(problem, "render with the same keys, or remove it to begin anew"));
    }
    tracing::info!(checkpoint = %path, spp = job.done, "resumed from {path} at {} spp", job.done);
    if about.shard.is_none() {
        job.samples.end = about.spp;
    }
    if job.done > about.spp {
        tracing::warn!("{path} has {} spp already: they are kept", job.done);
    }
    Ok(job)
}

/// Saves films: the checkpoint now and then, and all of them at the end.
pub(super) struct Saver<'a> {
    pub(super) args: &'a RenderArgs,
    pub(super) about: &'a About,
    pub(super) films: &'a [PathBuf],
    /// Why the last ones could not be saved.
    pub(super) failed: Vec<ImageError>,
    /// The films that were, besides the checkpoint.
    pub(super) written: Vec<PathBuf>,
}

impl Saver<'_> {
    pub(super) fn needed(&self) -> bool {
        self.args.checkpoint.is_some() || !self.films.is_empty()
    }

    pub(super) fn save(&mut self, job: &Job, last: bool) {
        self.failed.clear();
        let films = if last { self.films } else { &[] };
        for path in self.args.checkpoint.iter().chain(films) {
            let began = Instant::now();
            match film_file::write(path, self.about, job) {
                Ok(()) => {
                    if films.contains(path) {
                        self.written.push(path.clone());
                    }
                    let seconds = began.elapsed().as_secs_f64();
                    let path = path.display();
                    tracing::debug!(checkpoint = %path, spp = job.done, seconds, "saved {path} in {seconds:.3} s");
                }
                Err(error) => {
                    // Hours of work are not thrown away for a disk that is full now.
                    if !last {
                        tracing::warn!("the render goes on without a checkpoint: {error}");
                    }
                    self.failed.push(error);
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use std::sync::atomic::{AtomicBool, Ordering};

    use super::*;

    #[test]
    fn a_lock_is_one_run_s_also_while_another_gives_it_back() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("c.film.lock");
        let held = AtomicBool::new(false);
        let run = || {
            for _ in 0..3000 {
                if let Ok(lock) = Lock::at(path.clone()) {
                    assert!(!held.swap(true, Ordering::SeqCst), "two have it");
                    std::thread::yield_now();
                    held.store(false, Ordering::SeqCst);
                    drop(lock);
                }
            }
        };
        std::thread::scope(|scope| (0..4).for_each(|_| drop(scope.spawn(run))));
        assert!(!path.exists());
    }
}
