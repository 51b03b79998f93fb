//! How far one picture is from another: errors at four resolutions, and FLIP.
//!
//! `cargo run --release --example compare_pictures -- test.exr reference.exr`

use std::{error::Error, path::Path};

use yarnray::image::{
    self,
    metric::{Comparison, Pair},
};

fn main() -> Result<(), Box<dyn Error>> {
    let names: Vec<String> = std::env::args().skip(1).collect();
    let [test, reference] = names.as_slice() else { return Err("expected two pictures: TEST REFERENCE".into()) };
    let pair = Pair::new(&image::read(Path::new(test))?, &image::read(Path::new(reference))?)?;
    let comparison = Comparison::new(&pair).ok_or("no pixel of both pictures is finite")?;

    println!("mean of {test} over mean of {reference}: {:.4?}", comparison.mean_ratio);
    for errors in &comparison.errors {
        println!(
            "averaged over {0} x {0} pixels: relMSE {1:.6}, RMSE {2:.6}",
            errors.factor, errors.rel_mse, errors.rmse
        );
    }
    println!("FLIP as displayed: {:.4}", comparison.flip_ldr);
    Ok(())
}
