"""Figures of a result on axes of matplotlib."""

from dataclasses import dataclass
from typing import Any

from meeframe.common.errors import ResultError
from meeframe.results import figures, schema
from meeframe.results.canvas import on_axes
from meeframe.results.history import curves, draw_curve, unloading
from meeframe.results.overview import peaks
from meeframe.results.records import Result
from meeframe.results.selection import Which, select


@dataclass(frozen=True)
class Plots:
    """Figures of a result, each on given axes or on new ones, which are returned.

    The argument `step` selects the increment: the number of a load step, from 1, for its last increment; (step,
    increment); 'last'; or an increment such as result[3]. The default is the one of the peak load.

    Parameters
    ----------
    result : Result
        The result.
    """

    result: Result

    def pressure(self, ax: Any = None, *, step: Which = None) -> Any:
        """Draw the contact pressure; open nodes have the colour of the background.

        Parameters
        ----------
        ax : matplotlib.axes.Axes, optional
            Axes to draw on; new ones by default.
        step : int, tuple of int, str or StepResult, optional
            Increment; that of the peak load by default.

        Returns
        -------
        matplotlib.axes.Axes
            The axes.
        """
        return self.map("pressure", ax, step=step)

    def map(self, name: str, ax: Any = None, *, step: Which = None) -> Any:
        """Draw the map of a scalar field, with its bar.

        Parameters
        ----------
        name : str
            Name of the field, such as 'electric_potential' or 'gap'.
        ax : matplotlib.axes.Axes, optional
            Axes to draw on; new ones by default.
        step : int, tuple of int, str or StepResult, optional
            Increment; that of the peak load by default.

        Returns
        -------
        matplotlib.axes.Axes
            The axes.

        Raises
        ------
        ResultError
            If there is no scalar field of this name.
        """
        return on_axes(ax, lambda axes: figures.draw_map(axes, self.result, name, step, self._title(step)))

    def section(self, name: str = "pressure", ax: Any = None, *, step: Which = None) -> Any:
        """Draw a scalar field along x through the middle of the contact zone.

        Parameters
        ----------
        name : str, optional
            Name of the field, or 'tangential traction' for the traction along x; the pressure by default.
        ax : matplotlib.axes.Axes, optional
            Axes to draw on; new ones by default.
        step : int, tuple of int, str or StepResult, optional
            Increment; that of the peak load by default.

        Returns
        -------
        matplotlib.axes.Axes
            The axes.

        Raises
        ------
        ResultError
            If there is no scalar field of this name.
        """
        return on_axes(ax, lambda axes: figures.draw_section(axes, self.result, name, step))

    def stick_slip(self, ax: Any = None, *, step: Which = None) -> Any:
        """Draw the regions of stick and slip.

        Parameters
        ----------
        ax : matplotlib.axes.Axes, optional
            Axes to draw on; new ones by default.
        step : int, tuple of int, str or StepResult, optional
            Increment; that of the peak load by default.

        Returns
        -------
        matplotlib.axes.Axes
            The axes.

        Raises
        ------
        ResultError
            If the contact has no friction.
        """
        if schema.FRICTION not in peaks(self.result).phenomena:
            raise ResultError("the contact has no friction, and thus neither stick nor slip")
        return on_axes(ax, lambda axes: figures.draw_stick_slip(axes, self.result, step, self._title(step)))

    def history(self, name: str = "normal force", ax: Any = None) -> Any:
        """Draw a curve of the converged increments, with rings as markers where the indenter unloads.

        Parameters
        ----------
        name : str, optional
            'normal force' over approach, 'tangential force' over translation, 'contact area' over approach, 'charge'
            and 'magnetic flux' over normal force, or 'dissipated energy', as far as the case has them.
        ax : matplotlib.axes.Axes, optional
            Axes to draw on; new ones by default.

        Returns
        -------
        matplotlib.axes.Axes
            The axes.

        Raises
        ------
        ResultError
            If fewer than two increments have converged, or there is no curve of this name.
        """
        drawn = {curve.name: curve for curve in curves(self.result)}
        if not drawn:
            raise ResultError("a history needs at least two converged increments")
        if name not in drawn:
            raise ResultError(f"the history has no curve {name!r}; allowed: {', '.join(drawn)}")
        return on_axes(ax, lambda axes: draw_curve(axes, drawn[name], unloading(list(drawn.values()), drawn[name])))

    def convergence(self, ax: Any = None, *, step: Which = None) -> Any:
        """Draw the residual of the solver over its iterations.

        Parameters
        ----------
        ax : matplotlib.axes.Axes, optional
            Axes to draw on; new ones by default.
        step : int, tuple of int, str or StepResult, optional
            Increment; that of the peak load by default.

        Returns
        -------
        matplotlib.axes.Axes
            The axes.
        """
        return on_axes(ax, lambda axes: figures.draw_convergence(axes, self.result, step))

    def _title(self, step: Which) -> str:
        return figures.title_of(self.result, select(self.result, step))
