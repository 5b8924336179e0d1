"""Bytes between ground control and the vehicle: sockets, peers, signing, queues, framing."""
