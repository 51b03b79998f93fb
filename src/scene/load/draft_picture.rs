//! `draft = { image, weaves }` and `draft = { image, up }`: a draft as designers draw it, a pixel for each end and pick.

use glam::Vec3;

use super::{Context, Reader};
use crate::{
    pattern::draft::{Draft, DraftError},
    scene::{drawn_draft::Legend, palette},
};

/// What either of both keys looks like.
const WEAVES: &str = "weaves = { \"#ffffff\" = \"sateen 8\", \"#b02020\" = \"satin 8\" }, or up = \"#000000\"";

/// The draft; `None` where a mistake is told.
pub(super) fn draft(table: Reader<'_>, context: &Context<'_>) -> Option<Draft> {
    let span = table.span("image").unwrap_or(table.header());
    let path = table.required_string("image").map(|path| context.resolve(path, span));
    let legend = match [table.has("weaves"), table.has("up")] {
        [true, true] => {
            table.error_at("up", "both `up` and `weaves` are given", Some("keep one of them"));
            table.table("weaves").inspect(|weaves| weaves.keys().for_each(|sign| _ = weaves.string(sign)));
            table.string("up");
            None
        }
        [true, false] => table.required_table("weaves").and_then(|weaves| self::weaves(weaves, context)),
        [false, true] => table.string("up").and_then(|sign| color(&table, "up", sign, context)).map(Legend::Up),
        [false, false] => {
            table.error("neither `weaves` nor `up` says what the colours of the picture are", Some(WEAVES));
            None
        }
    };
    table.finish();
    let (path, legend) = (path?, legend?);
    match legend.draft(&path) {
        Ok(draft) => Some(draft),
        Err((problem, None)) => {
            context.wrong_file(&path, span, problem);
            None
        }
        Err((problem, hint)) => {
            context.error(span, problem, hint);
            None
        }
    }
}

fn weaves(table: Reader<'_>, context: &Context<'_>) -> Option<Legend> {
    let signs: Vec<&str> = table.keys().collect();
    if signs.is_empty() {
        table.error("`weaves` names no colour", Some(WEAVES));
    }
    let weaves: Vec<Option<(Vec3, Draft)>> = signs.iter().map(|sign| weave(&table, sign, context)).collect();
    table.finish();
    let weaves: Vec<(Vec3, Draft)> = weaves.into_iter().collect::<Option<_>>()?;
    (!weaves.is_empty()).then_some(Legend::Weaves(weaves))
}

/// A colour of the palette and its weave.
fn weave(table: &Reader<'_>, sign: &str, context: &Context<'_>) -> Option<(Vec3, Draft)> {
    let name = table.string(sign)?;
    let color = color(table, sign, sign, context)?;
    let draft = Draft::named(name).and_then(|draft| Legend::suits(name, &draft).map(|()| draft));
    let told = |error: DraftError| {
        table.error_at(sign, error.problem, Some(&error.hint));
    };
    draft.map_err(told).ok().map(|draft| (color, draft))
}

fn color(table: &Reader<'_>, key: &str, sign: &str, context: &Context<'_>) -> Option<Vec3> {
    let color = palette::color(sign);
    if color.is_none() {
        let span = table.span(key).unwrap_or(table.header());
        context.error(span, format!("`{sign}` is no colour"), Some("as in \"#b02020\"".to_owned()));
    }
    color
}
