//! The cases by name, small: what failed once is held by a test of its own.

use super::*;

fn holds(name: &str) {
    let case = cases().into_iter().find(|c| c.name == name).unwrap_or_else(|| panic!("no case {name}"));
    let outcome = run(&case, Scale::Quick);
    let failed: Vec<String> = outcome
        .checks
        .iter()
        .filter(|c| !c.passed())
        .map(|c| format!("{}: {} ({:?}) at {}", c.what, c.worst, c.bound, c.place))
        .collect();
    assert!(outcome.passed(), "{name}: {failed:#?} {:?}", outcome.panic);
}

#[test]
fn names_of_cases_are_unique() {
    let mut names: Vec<_> = cases().iter().map(|c| c.name).collect();
    names.sort_unstable();
    names.dedup();
    assert_eq!(names.len(), cases().len());
}

#[test]
fn a_failed_check_and_a_panic_fail_a_case() {
    let failing = Case {
        group: Group::Scattering,
        name: "fails",
        about: "",
        run: |_, checks| {
            checks.at_most("figure", 1.0, 2.0, &|| "here".to_owned());
            checks.at_most("figure", f64::NAN, 2.0, &|| "there".to_owned());
            checks.at_most("figure", 3.0, 2.0, &|| "elsewhere".to_owned());
        },
    };
    let outcome = run(&failing, Scale::Quick);
    assert!(!outcome.passed());
    assert!(outcome.checks[0].worst.is_nan() && outcome.checks[0].place == "there" && outcome.checks[0].count == 3);
    let dying = Case { run: |_, _| panic!("by design"), ..failing };
    let outcome = run(&dying, Scale::Quick);
    assert_eq!(outcome.panic.as_deref(), Some("by design"));
    assert!(!outcome.passed());
    let markdown = to_markdown(&[outcome], Scale::Quick, Duration::ZERO);
    assert!(markdown.contains("**fail**") && markdown.contains("by design"), "{markdown}");
    let idle = Case { run: |_, _| {}, ..failing };
    assert!(!run(&idle, Scale::Quick).passed(), "a case that checks nothing proves nothing");
}

#[test]
fn closed_forms_keep_their_digits() {
    holds("closed_forms");
    holds("extinction_rate");
    holds("single_precision");
    holds("branches");
}

// Each of these failed once.

#[test]
fn light_of_1e20_and_of_1e_minus_20_is_linear() {
    // A film counted in fixed steps: the one was refused, the other lost.
    holds("extreme_lights");
}

#[test]
fn strongly_twisted_plies_do_not_jump_where_rays_turn_steep() {
    // Two rounds of placing them below 45 degrees and three above: 0.6 fibres on one side, 43 on the other.
    holds("section_branches");
}

#[test]
fn a_single_fiber_that_fills_its_yarn_keeps_its_light() {
    // The chords ahead saw thousands of fibres and lobe F was lost, a third of the light.
    holds("fiber_counts");
}

#[test]
fn rays_along_a_yarn_make_no_light() {
    // The mean of F's gain was taken in a direction without azimuth: a third more light came out.
    holds("rays_on_a_yarn");
}

#[test]
fn rays_exactly_across_a_yarn_are_not_offered_hundreds_of_hits() {
    // Shadow rays to a distant light straight above: 114 filter calls in the mean, up to 686.
    holds("exact_rays");
}
