// MuJoCo's constraint solvers on contact problems that were not made by its own pipeline. Results of
// mj_fwdPosition and mj_makeConstraint are written into mjData here. Compiled by mujoco_rows.py, called by way of
// ctypes.
#include <mujoco/mjxmacro.h>
#include <mujoco/mujoco.h>
#include <stdlib.h>
#include <string.h>

// Not in mujoco.h, but exported.
void mj_island(const mjModel* m, mjData* d);
void mju_superSparse(int rows, int* super, const int* counts, const int* addresses, const int* columns);

typedef struct {
  int equality_count, friction_loss_count, row_count, contact_count;
  const double *jacobian, *inertia;             // (row_count x nv), (nC) in the order of MuJoCo's sparse M
  const double *free_acceleration, *target;     // (nv), (row_count)
  const double *compliance, *friction_loss;     // (row_count)
  const int *type, *id;                         // (row_count)
  const int *contact_row, *contact_size;        // (contact_count)
  const double *contact_mu, *contact_friction;  // (contact_count), (contact_count x 5)
} Problem;

static void* room(size_t count, size_t size) {
  return calloc(count ? count : 1, size);
}

// Returns 1 if one of the rows has an entry in this column.
static int any(const double* column, int stride, int row, int end) {
  while (row < end && column[row * stride] == 0) {
    ++row;
  }
  return row < end;
}

static void jacobian_rows(const mjModel* m, mjData* d, const double* jacobian, const int* type, const int* id) {
  if (!mj_isSparse(m)) {
    memcpy(d->efc_J, jacobian, sizeof(double) * (size_t)d->nefc * (size_t)m->nv);
    return;
  }
  int entry = 0;
  for (int first = 0, end; first < d->nefc; first = end) {
    // MuJoCo takes the rows of one contact to have one pattern.
    for (end = first + 1;
         end < d->nefc && type[end] == mjCNSTR_CONTACT_ELLIPTIC && type[first] == type[end] && id[end] == id[first];) {
      ++end;
    }
    for (int row = first; row < end; ++row) {
      d->efc_J_rowadr[row] = entry;
      for (int dof = 0; dof < m->nv; ++dof) {
        if (any(jacobian + dof, m->nv, first, end)) {
          d->efc_J_colind[entry] = dof;
          d->efc_J[entry++] = jacobian[row * m->nv + dof];
        }
      }
      d->efc_J_rownnz[row] = entry - d->efc_J_rowadr[row];
    }
  }
  mju_superSparse(d->nefc, d->efc_J_rowsuper, d->efc_J_rownnz, d->efc_J_rowadr, d->efc_J_colind);
}

// MuJoCo asks a contact's geoms which trees it joins, any other row's Jacobian. There are no geoms here, so contacts
// pass for limits while islands are looked for.
static void islands(const mjModel* m, mjData* d, const Problem* p) {
  for (int i = 0; i < d->nefc; ++i) {
    const int contact = p->type[i] == mjCNSTR_CONTACT_ELLIPTIC;
    d->efc_type[i] = contact ? mjCNSTR_LIMIT_TENDON : p->type[i];
    d->efc_id[i] = contact ? d->nefc + p->id[i] : p->id[i];
  }
  for (int i = 0; !mj_isSparse(m) && i < p->contact_count; ++i) {
    const int row = p->contact_row[i];
    for (int dof = 0; dof < m->nv; ++dof) {
      d->efc_J[row * m->nv + dof] = any(p->jacobian + dof, m->nv, row, row + p->contact_size[i]);
    }
  }
  mj_island(m, d);
  if (!mj_isSparse(m)) {
    memcpy(d->efc_J, p->jacobian, sizeof(double) * (size_t)d->nJ);
  }
  memcpy(d->efc_type, p->type, sizeof(int) * (size_t)d->nefc);
  memcpy(d->efc_id, p->id, sizeof(int) * (size_t)d->nefc);
  for (int i = 0; d->nisland && i < d->nefc; ++i) {
    d->iefc_type[d->map_efc2iefc[i]] = p->type[i];
    d->iefc_id[d->map_efc2iefc[i]] = p->id[i];
  }
}

// An environment ready for mj_fwdConstraint, islands found; released by peer_free.
mjData* peer_make(const mjModel* m, const Problem* p) {
  mjData* d = mj_makeData(m);
  d->ne = p->equality_count;
  d->nf = p->friction_loss_count;
  d->nl = 0;
  d->nefc = p->row_count;
  d->ncon = p->contact_count;
  d->nJ = p->row_count * m->nv;
  d->efm_active = 0;
#undef MJ_M
#undef MJ_D
#define MJ_M(n) m->n
#define MJ_D(n) d->n
#define X(type, name, rows, columns) d->name = room((size_t)(rows) * (size_t)(columns), sizeof(type));
#define XNV X
  MJDATA_ARENA_POINTERS_SOLVER
#undef XNV
#undef X
#undef MJ_M
#undef MJ_D
  d->contact = room((size_t)p->contact_count, sizeof(mjContact));
  for (int i = 0; i < p->contact_count; ++i) {
    mjContact* contact = d->contact + i;
    contact->dim = p->contact_size[i];
    contact->efc_address = p->contact_row[i];
    contact->mu = p->contact_mu[i];
    memcpy(contact->friction, p->contact_friction + 5 * i, sizeof contact->friction);
    contact->geom[0] = contact->geom[1] = contact->geom1 = contact->geom2 = -1;
  }
  for (int i = 0; i < p->row_count; ++i) {
    d->efc_R[i] = p->compliance[i];
    d->efc_D[i] = 1 / p->compliance[i];
    d->efc_frictionloss[i] = p->friction_loss[i];
    d->efc_aref[i] = p->target[i];
  }
  jacobian_rows(m, d, p->jacobian, p->type, p->id);
  memcpy(d->M, p->inertia, sizeof(double) * (size_t)m->nC);
  mj_factorM(m, d);
  memcpy(d->qacc_smooth, p->free_acceleration, sizeof(double) * (size_t)m->nv);
  mj_mulM(m, d, d->qfrc_smooth, d->qacc_smooth);
  islands(m, d, p);
  return d;
}

void peer_free(const mjModel* m, mjData* d) {
#define X(type, name, rows, columns) free(d->name);
#define XNV X
  MJDATA_ARENA_POINTERS_SOLVER
#undef XNV
#undef X
      (void)
  m;
  free(d->contact);
  mj_deleteData(d);
}

// Accelerations to start from (count x nv); ignored where the model disables warm starts.
void peer_start(const mjModel* m, mjData** all, int count, const double* acceleration) {
  for (int i = 0; i < count; ++i) {
    memcpy(all[i]->qacc_warmstart, acceleration + (size_t)i * (size_t)m->nv, sizeof(double) * (size_t)m->nv);
  }
}

// Computes A = J M^-1 J' + R, which the dual solver needs; its memory is taken from the arena and given back.
void peer_project(const mjModel* m, mjData** all, int count) {
  for (int i = 0; i < count; ++i) {
    const mjtSize before = all[i]->parena;
    mj_projectConstraint(m, all[i]);
    all[i]->parena = before;
  }
}

void peer_factor(const mjModel* m, mjData** all, int count) {
  for (int i = 0; i < count; ++i) {
    mj_factorM(m, all[i]);
  }
}

void peer_solve(const mjModel* m, mjData** all, int count) {
  for (int i = 0; i < count; ++i) {
    mj_fwdConstraint(m, all[i]);
  }
}

// Forces of the rows, one environment after another, and iterations (the most of an environment's islands).
void peer_answer(mjData** all, int count, double* force, int* iterations) {
  for (int i = 0; i < count; ++i) {
    memcpy(force, all[i]->efc_force, sizeof(double) * (size_t)all[i]->nefc);
    force += all[i]->nefc;
    iterations[i] = 0;
    for (int k = 0; k < (all[i]->nisland < mjNISLAND ? all[i]->nisland : mjNISLAND) || k == 0; ++k) {
      iterations[i] = all[i]->solver_niter[k] > iterations[i] ? all[i]->solver_niter[k] : iterations[i];
    }
  }
}
