"""What fails in a flight, and when: data from a scenario or a command, and a link that loses datagrams."""
