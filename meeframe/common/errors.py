"""Errors that a user can cause and correct; anything else is a defect of meeframe."""


class MeeframeError(Exception):
    """Base of every error that bad input can cause; its text is the whole message shown to the user."""


class MaterialError(MeeframeError):
    """A material is incomplete, asymmetric or inadmissible."""


class MeshError(MeeframeError):
    """A surface mesh is open, inverted, degenerate or lacks a named face group."""


class CaseError(MeeframeError):
    """A case file has an unknown, missing or unacceptable entry."""


class TooLargeError(MeshError, CaseError):
    """A mesh needs more memory than there is; with more memory the same case may run."""


class PluginError(MeeframeError):
    """A plugin is unknown, duplicate or broken."""


class PluginFault(PluginError):
    """Code of a plugin failed while it was used; once it is corrected, the same case may run."""


class ResultError(MeeframeError):
    """A result cannot be written or read."""
