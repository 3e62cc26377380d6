"""n"""
from dataclasses import dataclass, replace
from typing import Final, final
import numpy as np
from scipy.linalg import lu_factor, lu_solve, solve
from meeframe.core.contact import *
from meeframe.solvers.nonsmooth import *
from meeframe.solvers.nonsmooth import CLOSED, FLUX, LOAD
import os

def dense_step(eq, bl):
    n = len(bl.a)
    matrix = eq.problem.system.dense().reshape(5*n,5*n)
    coupled = bl.b.any(axis=2)
    off = bl.a.copy(); off[:, np.arange(6), np.arange(6)] = 0
    coupled |= off.any(axis=2)
    step = np.zeros((n,6))
    diag = bl.a[:, np.arange(6), np.arange(6)]
    step[~coupled] = (-bl.residual/np.where(coupled,1,diag))[~coupled]
    known = eq.problem.system.apply(step[:, :5])
    rhs = -bl.residual - np.einsum('nij,nj->ni', bl.a, step) - np.einsum('nij,nj->ni', bl.b, known)
    rhs = rhs[coupled]
    node, row = np.nonzero(coupled)
    number = np.full((n,6), -1); number[coupled] = np.arange(len(node))
    cols = np.flatnonzero(coupled[:, :5].ravel())
    cpos = number[:, :5].ravel()[cols]
    J = np.zeros((len(node), len(node)))
    for k in range(5):
        c = bl.b[node,row,k]
        sel = np.flatnonzero(c)
        if len(sel):
            J[np.ix_(sel, cpos)] += c[sel][:,None] * matrix[np.ix_(node[sel]*5+k, cols)]
    for k in range(6):
        sel = np.flatnonzero((number[node,k]>=0))
        J[sel, number[node[sel],k]] += bl.a[node[sel],row[sel],k]
    scale = np.append(eq.scales.load, 1.0)[row]
    step[coupled] = scale * solve(J*scale, rhs, check_finite=False)
    return step

@dataclass(frozen=True, eq=False)
class _M:
    point: object
    flips: object

R = float(os.environ.get("RF", 1))
@final
@dataclass(frozen=True)
class SemismoothNewton(Solver):
    def init(self, problem, start):
        eq = Equation.of(problem, R)
        n = len(problem.gap)
        load = np.zeros((n,5)) if start is None else start.load
        pt = eq.at(load, np.zeros(n), np.zeros(n,bool))
        return Iterate(load, pt.closed, _M(pt, np.zeros(n)))
    def step(self, problem, iterate):
        pt = iterate.memory.point; eq = pt.equation
        st = dense_step(eq, pt.linearise())
        load = pt.load + st[:, :5]
        load[:, :3] = problem.contact_law.project(load[:, :3])
        new = eq.at(load, pt.closed + st[:,5], pt.grazing)
        flips = iterate.memory.flips + ((new.closed>0)!=(pt.closed>0))*~new.grazing*(new.jump.any(axis=1))
        graze = new.grazing | (flips>2)
        new = eq.at(load, new.closed, graze)
        if 'V' in os.environ: print("   merit", new.merit, (load[:,2]<0).sum(), graze.sum(), flips.max())
        return Iterate(load, np.clip(new.closed,0,1), _M(new, flips))
