"""Local processes of a sweep listen on the loopback interface only."""

from ipaddress import ip_address

import pytest

from meeframe.study.sweep.engine import pool_of

pytest.importorskip("distributed")
psutil = pytest.importorskip("psutil")


@pytest.mark.full
def test_local_processes_listen_on_loopback_only():
    with pool_of(2, None, (), 2) as pool:
        pool.connect().wait_for_workers(2)
        this = psutil.Process()
        open_addresses = [
            connection.laddr.ip
            for process in (this, *this.children(recursive=True))
            for connection in process.net_connections("inet")
            if connection.status == psutil.CONN_LISTEN
        ]
    assert len(open_addresses) >= 3  # scheduler and workers
    assert all(ip_address(address).is_loopback for address in open_addresses), open_addresses
