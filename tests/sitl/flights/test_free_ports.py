"""Ports for processes that are launched a moment later."""

from __future__ import annotations

import socket

import pytest

from sitl.flights import free_ports

KINDS = [socket.SOCK_DGRAM, socket.SOCK_STREAM]


@pytest.mark.parametrize("kind", KINDS)
def test_they_differ_and_whoever_sends_without_a_port_of_his_own_gets_none_of_them(
    kind: socket.SocketKind,
) -> None:
    ports = free_ports.free_ports(50, kind)
    assert len(set(ports)) == 50
    with socket.socket(socket.AF_INET, kind) as anybody:
        anybody.bind(("127.0.0.1", 0))
        assert anybody.getsockname()[1] > max(ports)


def test_a_port_in_use_is_not_given(monkeypatch: pytest.MonkeyPatch) -> None:
    [taken] = free_ports.free_ports(1)
    monkeypatch.setattr(free_ports, "FIRST", taken)
    monkeypatch.setattr(free_ports, "LAST", taken)
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as holder:
        holder.bind(("127.0.0.1", taken))
        with pytest.raises(OSError, match="there are only 0"):
            free_ports.free_ports(1)
