"""The environment that a launched process hands on."""

import os

from mufe_fenicsx.machine.mpi_launcher import environment_without_launcher, forget_launcher


def test_what_the_launcher_left_goes_and_settings_of_the_user_stay(monkeypatch):
    left = ("PMI_RANK", "PMIX_NAMESPACE", "OMPI_COMM_WORLD_SIZE", "OMPI_MCA_num_procs")
    kept = ("OMPI_ALLOW_RUN_AS_ROOT_CONFIRM", "OMPI_MCA_rmaps_base_oversubscribe", "PATH")
    for name in (*left, *kept[:2]):
        monkeypatch.setenv(name, "1")
    handed = environment_without_launcher()
    assert not handed.keys() & set(left) and handed.keys() >= set(kept)
    forget_launcher()
    assert environment_without_launcher() == handed
    assert dict(os.environ) == handed
