//! The server as pages, programs and strangers meet it.

mod hostile;
mod http;
mod page;
mod pictures;
mod protocol;
mod requests;
mod stages;
mod studio;
mod viewer;
