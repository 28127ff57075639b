# The solvers of contact batches, in the order of SolverKind (core/include/stiction/types.hpp). A new one is one line
# here and one there (docs/tutorials/writing_a_solver.md). Solvers of bodies have kernels of another form and are not of
# this list.
include(stiction_add_solver)

stiction_add_solver(pgs Pgs WIDE_PACKS)
stiction_add_solver(npgs Npgs WIDE_PACKS)
stiction_add_solver(jacobi Jacobi)
stiction_add_solver(apgd Apgd)
stiction_add_solver(nsgs Nsgs)
stiction_add_solver(admm Admm FACTORISES)
stiction_add_solver(newton Newton FACTORISES)
stiction_add_solver(lemke Lemke FACTORISES)
stiction_add_solver(ipm Ipm FACTORISES)
stiction_add_solver(subspace Subspace WIDE_PACKS)
