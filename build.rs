//! Records the commit, and with the feature `oiio` builds the small library through which OpenImageIO is reached.

use std::process::Command;

fn main() {
    println!("cargo::rerun-if-changed=build.rs");
    println!("cargo::rerun-if-changed=Cargo.toml");
    // The commit is "-dirty" as soon as a source differs from it.
    println!("cargo::rerun-if-changed=src");
    println!("cargo::rustc-env=YARNRAY_COMMIT={}", commit());
    #[cfg(feature = "oiio")]
    oiio::build();
}

/// What git prints, or nothing if there is no git or no repository.
fn git(arguments: &[&str]) -> Option<String> {
    let output = Command::new("git").arg("--no-optional-locks").args(arguments).output().ok()?;
    output.status.success().then(|| String::from_utf8_lossy(&output.stdout).trim().to_owned())
}

/// The commit this build is made from: a short hash, "-dirty" behind it if tracked files differ, or "unknown".
fn commit() -> String {
    let Some(hash) = git(&["rev-parse", "--short=12", "HEAD"]) else { return "unknown".to_owned() };
    // In a worktree `.git` is a file; git knows where HEAD and the branch really are.
    let branch = git(&["symbolic-ref", "-q", "HEAD"]);
    for name in ["HEAD", "packed-refs"].into_iter().chain(branch.as_deref()) {
        // A file that does not exist would make cargo run this script every time.
        if let Some(path) =
            git(&["rev-parse", "--git-path", name]).filter(|path| std::fs::exists(path).unwrap_or(false))
        {
            println!("cargo::rerun-if-changed={path}");
        }
    }
    let dirty = git(&["status", "--porcelain", "--untracked-files=no"]).is_none_or(|changes| !changes.is_empty());
    if dirty { format!("{hash}-dirty") } else { hash }
}

#[cfg(feature = "oiio")]
mod oiio {
    use std::{
        env, fs,
        os::unix::fs::MetadataExt,
        path::{Path, PathBuf},
        process,
    };

    /// Compiles `ffi/oiio.cpp` to OUT_DIR/liboiio_face.so and makes bindings that look its functions up at run time.
    ///
    /// A shared library of its own, because a program that merely links OpenImageIO loads 260 libraries when it
    /// starts (126 MB and 0.17 s on Debian 12), needed or not.
    pub(super) fn build() {
        println!("cargo::rerun-if-changed=ffi/oiio.h");
        println!("cargo::rerun-if-changed=ffi/oiio.cpp");
        println!("cargo::rerun-if-env-changed=OPENIMAGEIO_DIR");
        let out = PathBuf::from(env::var_os("OUT_DIR").expect("cargo sets OUT_DIR"));
        let library = out.join("liboiio_face.so");
        let dependencies = out.join("oiio_face.d");
        // An OpenImageIO outside the system's folders: OPENIMAGEIO_DIR/include and OPENIMAGEIO_DIR/lib.
        let prefix = env::var("OPENIMAGEIO_DIR").unwrap_or_default();
        let stamp = out.join("oiio_face.prefix");
        let same_prefix = fs::read_to_string(&stamp).is_ok_and(|before| before == prefix);
        if !same_prefix || !is_current(&library, &dependencies) {
            compile(&library, &dependencies, &prefix);
            fs::write(&stamp, &prefix).expect("OUT_DIR is writable");
        }
        for header in listed(&dependencies).filter(|path| path.ends_with("OpenImageIO/oiioversion.h")) {
            println!("cargo::rerun-if-changed={}", header.display());
        }
        bindgen::Builder::default()
            .header("ffi/oiio.h")
            .allowlist_function("yarnray_oiio_.*")
            .allowlist_type("YarnrayOiio.*")
            .allowlist_var("YARNRAY_OIIO_.*")
            .default_macro_constant_type(bindgen::MacroTypeVariation::Signed)
            .dynamic_library_name("Face")
            .dynamic_link_require_all(true)
            .generate()
            .unwrap_or_else(|error| fail(&format!("cannot make bindings from ffi/oiio.h: {error}")))
            .write_to_file(out.join("oiio_face.rs"))
            .expect("OUT_DIR is writable");
    }

    fn fail(message: &str) -> ! {
        eprintln!("{message}");
        // Shown even where cargo does not print what a build script wrote.
        println!("cargo::error={}", message.lines().next().unwrap_or_default());
        process::exit(1);
    }

    /// The files that a make rule lists as prerequisites.
    fn listed(rule: &Path) -> impl Iterator<Item = PathBuf> {
        let text = fs::read_to_string(rule).unwrap_or_default();
        let files: Vec<_> = text.split_whitespace().skip(1).filter(|word| *word != "\\").map(PathBuf::from).collect();
        files.into_iter()
    }

    /// Whether no source or header has changed since the library was made, so that an edit of a Rust file does not
    /// cost a C++ compilation. Packages keep old modification times, hence the time of the change of status.
    fn is_current(library: &Path, dependencies: &Path) -> bool {
        let Ok(made) = fs::metadata(library).map(|file| file.ctime()) else { return false };
        let script = listed(dependencies).next().map(|_| PathBuf::from("build.rs"));
        script.is_some()
            && listed(dependencies).chain(script).all(|path| fs::metadata(path).is_ok_and(|file| file.ctime() < made))
    }

    fn compile(library: &Path, dependencies: &Path, prefix: &str) {
        let mut build = cc::Build::new();
        build.cpp(true).std("c++17").opt_level(2).debug(false).pic(true).cargo_metadata(false).cargo_warnings(false);
        let Ok(compiler) = build.try_get_compiler() else { fail(MISSING) };
        let mut command = compiler.to_command();
        command.args(["-shared", "-fPIC", "-fvisibility=hidden", "-s", "-MD", "-MF"]).arg(dependencies);
        if !prefix.is_empty() {
            command.arg(format!("-I{prefix}/include"));
        }
        command.arg("ffi/oiio.cpp").arg("-o").arg(library);
        if !prefix.is_empty() {
            command.args([format!("-L{prefix}/lib"), format!("-Wl,-rpath,{prefix}/lib")]);
        }
        command.args(["-Wl,--no-undefined", "-lOpenImageIO", "-lOpenImageIO_Util"]);
        let output = command.output().unwrap_or_else(|error| {
            fail(&format!("cannot run the C++ compiler {}: {error}; run tools/setup", compiler.path().display()))
        });
        if !output.status.success() {
            let text = String::from_utf8_lossy(&output.stderr);
            // As GCC, Clang and the linkers say it.
            let header = text.contains("OpenImageIO/imageio.h: No such file")
                || text.contains("'OpenImageIO/imageio.h' file not found");
            if header || text.contains("find -lOpenImageIO") || text.contains("library not found for -lOpenImageIO") {
                fail(MISSING);
            }
            fail(&format!("ffi/oiio.cpp does not compile against the OpenImageIO that is installed\n{text}"));
        }
    }

    const MISSING: &str = "OpenImageIO is missing: run tools/setup, or build with --no-default-features";
}
