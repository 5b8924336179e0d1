"""The plant (`sitl_bridge.plant`) and what both processes share: vehicle description, frames, MAVLink."""
