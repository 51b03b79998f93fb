//! What a yarn scatters back and lets through, by the hierarchical model and by its explicit fibres, from three sides.
//!
//! `cargo run --release --example scatter_of_a_yarn`

use std::error::Error;

use yarnray::{
    experiment::goniometer::{Effort, Specimen, View, measure, truth},
    scattering::fiber::FiberMaterial,
    scene::{Model, Yarn},
};

fn main() -> Result<(), Box<dyn Error>> {
    // Three plies of 60 fibres each, which fill a third of them; blue.
    let cotton = FiberMaterial { r: [0.04; 3], tt: [0.3, 0.5, 0.7], d: [0.1, 0.15, 0.25], ..FiberMaterial::default() };
    let twists = [30f64.to_radians(), -20f64.to_radians()];
    let yarn = Yarn::of_equal_plies("cotton", 0.2, 3, 60, 0.33, twists, ("cotton".to_owned(), cotton))?;

    println!("latitude     model: back  forward     fibres: back  forward   (blue channel, shares of the light)");
    for degrees in [0.0, 30.0, 60.0] {
        // Rays over the whole width of the yarn, its plies at any phase.
        let view = View { theta: f64::to_radians(degrees), ..View::default() };
        let model = measure(&Specimen::Yarn(&yarn, Model::Aggregated), &view, Effort { paths: 100_000, seed: 1 });
        let fibers = truth(&yarn, &view, Effort { paths: 20_000, seed: 1 })?;
        let [(back, forward), (true_back, true_forward)] = [model.energies(), fibers.energies()];
        println!(
            "{degrees:>8} {:>16.3} {:>8.3} {:>16.3} {:>8.3}   +- {:.3}",
            back[2].mean,
            forward[2].mean,
            true_back[2].mean,
            true_forward[2].mean,
            true_back[2].se.unwrap_or(f64::NAN)
        );
    }
    Ok(())
}
