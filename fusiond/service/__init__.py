"""The daemon: Zenoh sessions, wire formats, the loop; and `client`, the other end of it."""
