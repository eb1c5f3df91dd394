//! The interactive viewer: a server, and the page in which a scene is ray traced as one moves in it.
//!
//! A [`Server`] paints through a [`Renderer`](surfel::render::Renderer) what a [`Studio`] makes of the
//! settings that pages send: the program that starts the server implements it. docs/server.md gives the
//! messages between page and server, and what programs may ask.

mod camera;
mod canvas;
mod client;
mod easel;
mod encode;
mod frame;
mod guard;
mod hall;
mod hurry;
pub mod limits;
mod message;
mod pace;
mod page;
mod pick;
mod routes;
mod server;
mod session;
mod staging;
pub mod studio;
mod telling;
mod wishes;

pub use server::Server;
pub use studio::{Error, Keys, Place, Result, Stage, Studio, Written};
