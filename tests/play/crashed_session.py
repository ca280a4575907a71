"""Sessions that crashed, and the folders that they left."""


def crashed(session):
    """End a session as a crash does: the operating system has what was handed to it, and the locks are free."""
    session.timeline.flush()
    session._recovery._lock.release()
    for branch in session.branches.values():
        branch.recorder.recording._work._lock.release()
    session.simulation.close()


def sessions(state):
    """Names of the folders of sessions that run or that a crash left."""
    return [folder.name for folder in state.iterdir() if folder.name not in ("trash", "damaged")]


def thrown_away(state):
    """Folders in the trash."""
    return sorted((state / "trash").iterdir()) if (state / "trash").exists() else []
