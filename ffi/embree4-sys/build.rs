//! Makes the bindings from the Embree that is installed: the sizes of `RTCHit` and `RTCRayQueryContext`
//! depend on how Embree was configured, so headers from elsewhere are memory-unsafe.

use std::{env, path::PathBuf, process};

fn main() {
    println!("cargo::rerun-if-changed=embree.h");
    println!("cargo::rerun-if-env-changed=EMBREE_DIR");
    println!("cargo::rustc-link-lib=embree4");

    let mut builder = bindgen::Builder::default()
        .header("embree.h")
        .allowlist_function("rtc.*")
        .allowlist_type("RTC.*")
        .allowlist_var("RTC_.*")
        .default_enum_style(bindgen::EnumVariation::Consts)
        .prepend_enum_name(false)
        .derive_default(false)
        .generate_comments(false)
        .layout_tests(true);
    // An Embree outside the system's folders: EMBREE_DIR/include and EMBREE_DIR/lib.
    if let Ok(dir) = env::var("EMBREE_DIR") {
        builder = builder.clang_arg(format!("-I{dir}/include"));
        println!("cargo::rustc-link-search=native={dir}/lib");
    }
    let bindings = builder.generate().unwrap_or_else(|error| {
        eprintln!("embree4-sys: cannot read embree4/rtcore.h ({error})");
        eprintln!("embree4-sys: run tools/setup, or set EMBREE_DIR to where Embree 4 is installed");
        process::exit(1);
    });
    let out = PathBuf::from(env::var_os("OUT_DIR").expect("cargo sets OUT_DIR"));
    bindings.write_to_file(out.join("bindings.rs")).expect("OUT_DIR is writable");
}
