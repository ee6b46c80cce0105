//! Who sees what: ray casting against the proxy.
