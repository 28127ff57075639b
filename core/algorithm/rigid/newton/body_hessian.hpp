#pragma once

#include "core/algorithm/rigid/newton/body_gradient.hpp"

/// H = M + J'WJ, block by block (docs/math/body_newton.md, (5)).
namespace stiction::inline STICTION_ISA {

/// W of one contact in world axes, from scale P in its own.
STICTION_HD void turn_stiffness(SpaceContact& contact, const double (&P)[3][3], double scale) {
  const Vector3<double> axes[3] = {contact.frame.n, contact.frame.t1, contact.frame.t2};
  double turned[3][3];  // P E', rows of the frame, columns of the world
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j) turned[i][j] = 0.0;
  for (int i = 0; i < 3; ++i)
    for (int k = 0; k < 3; ++k) {
      turned[i][0] = fma_(P[i][k], axes[k].x, turned[i][0]);
      turned[i][1] = fma_(P[i][k], axes[k].y, turned[i][1]);
      turned[i][2] = fma_(P[i][k], axes[k].z, turned[i][2]);
    }
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j) {
      double sum = 0.0;
      for (int k = 0; k < 3; ++k) {
        const double axis = i == 0 ? axes[k].x : i == 1 ? axes[k].y : axes[k].z;
        sum = fma_(axis, turned[k][j], sum);
      }
      contact.stiffness[3 * i + j] = scale * sum;
    }
}

/// sum = sum + sign [1; [r_s]x] W [1, -[r_t]x]: how a contact resists the motion of body t at body s.
STICTION_HD void add_stiffness(double* sum, const double (&w)[9], double sign, const Vector3<double>& r_s,
                               const Vector3<double>& r_t) {
  const Vector3<double> rows[3] = {{w[0], w[1], w[2]}, {w[3], w[4], w[5]}, {w[6], w[7], w[8]}};
  double top[3][kBodyBlock];  // W [1, -[r_t]x]: each row w', (r_t x w)'
  for (int i = 0; i < 3; ++i) {
    const Vector3<double> turned = cross(r_t, rows[i]);
    top[i][0] = rows[i].x;
    top[i][1] = rows[i].y;
    top[i][2] = rows[i].z;
    top[i][3] = turned.x;
    top[i][4] = turned.y;
    top[i][5] = turned.z;
  }
  for (int j = 0; j < kBodyBlock; ++j) {
    const Vector3<double> column{top[0][j], top[1][j], top[2][j]};
    const Vector3<double> torque = cross(r_s, column);
    const double entries[kBodyBlock] = {column.x, column.y, column.z, torque.x, torque.y, torque.z};
    for (int i = 0; i < kBodyBlock; ++i) sum[i * kBodyBlock + j] = fma_(sign, entries[i], sum[i * kBodyBlock + j]);
  }
}

STICTION_HD void start_diagonal(double* sum, const SpaceBody& body) {
  const Symmetric3<double>& m = body.inertia;
  const double inertia[3][3] = {{m.xx, m.xy, m.xz}, {m.xy, m.yy, m.yz}, {m.xz, m.yz, m.zz}};
  for (int i = 0; i < 3; ++i) {
    sum[i * kBodyBlock + i] = body.mass;
    for (int j = 0; j < 3; ++j) sum[(3 + i) * kBodyBlock + 3 + j] = inertia[i][j];
  }
}

/// One block of M + J'WJ.
STICTION_HD void assemble_block(const SpaceWorkspace& workspace, Index row, Index k, double* sum) {
  const NewtonStream& stream = workspace.stream;
  const bool is_diagonal = stream.pattern.columns[k] == row;
  for (Index i = 0; i < kBlockEntries; ++i) sum[i] = 0.0;
  if (is_diagonal) start_diagonal(sum, workspace.body[row]);
  for (Index e = stream.block_offsets[k]; e < stream.block_offsets[k + 1]; ++e) {
    const Index entry = stream.block_contacts[e];
    const SpaceContact& contact = workspace.contact[entry >= 0 ? entry : ~entry];
    const Vector3<double>& own = entry >= 0 ? contact.arm_b : contact.arm_a;
    const Vector3<double>& other = entry >= 0 ? contact.arm_a : contact.arm_b;
    add_stiffness(sum, contact.stiffness, is_diagonal ? 1.0 : -1.0, own, is_diagonal ? own : other);
  }
}

/// W of a contact as it is held, slides or is open.
STICTION_HD void turn_curvature(SpaceContact& contact, double compliance) {
  turn_stiffness(contact, project_friction_cone(contact.z, contact.mu).P, div_(1.0, compliance + contact.prox_weight));
}

/// A block above the diagonal from its transpose, so that H is symmetric to the last bit.
STICTION_HD void mirror_block(const double* lower, double* upper) {
  for (Index i = 0; i < kBodyBlock; ++i)
    for (Index j = 0; j < kBodyBlock; ++j) upper[i * kBodyBlock + j] = lower[j * kBodyBlock + i];
}

/// A block of H at or below the diagonal; entries above it in the diagonal block mirror those below.
STICTION_HD void assemble_lower_block(const SpaceWorkspace& workspace, Index row, Index k) {
  double* const sum = workspace.H.block(k);
  assemble_block(workspace, row, k, sum);
  if (workspace.stream.pattern.columns[k] != row) return;
  for (Index i = 0; i < kBodyBlock; ++i)
    for (Index j = 0; j < i; ++j) sum[j * kBodyBlock + i] = sum[i * kBodyBlock + j];
}

/// Fills workspace.H for the reactions' derivative where they are. One lane makes a block of the lower half; the upper
/// half is its mirror image, so that H is symmetric to the last bit.
template <Team TeamT>
STICTION_HD_OUTLINE void assemble_curvature(TeamT& team, const SpaceWorkspace& workspace, double compliance) {
  for_each(team, workspace.contacts, [&](Index p) { turn_curvature(workspace.contact[p], compliance); });
  const BlockPattern& pattern = workspace.stream.pattern;
  for_each(team, workspace.bodies, [&](Index row) {
    for (Index k = pattern.offsets[row]; k < pattern.offsets[row + 1] && pattern.columns[k] <= row; ++k)
      assemble_lower_block(workspace, row, k);
  });
  for_each(team, workspace.bodies, [&](Index row) {
    for (Index k = pattern.offsets[row]; k < pattern.offsets[row + 1]; ++k) {
      if (pattern.columns[k] <= row) continue;
      mirror_block(workspace.H.block(workspace.stream.mirror[k]), workspace.H.block(k));
    }
  });
}

/// Fills workspace.sliding for the stiffnesses that the contacts have.
template <Team TeamT>
STICTION_HD_OUTLINE void assemble_sliding(TeamT& team, const SpaceWorkspace& workspace) {
  const BlockPattern& pattern = workspace.stream.pattern;
  for_each(team, workspace.bodies, [&](Index row) {
    for (Index k = pattern.offsets[row]; k < pattern.offsets[row + 1]; ++k)
      assemble_block(workspace, row, k, workspace.sliding.block(k));
  });
}

}  // namespace stiction::inline STICTION_ISA
