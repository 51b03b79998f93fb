//! A renderer for knitted and woven cloth: yarns as curves, fibres by an analytic model.
#![deny(unsafe_code)]

pub mod geometry;
