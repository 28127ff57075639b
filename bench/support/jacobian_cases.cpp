#include "bench/support/jacobian_cases.hpp"

#include <algorithm>
#include <filesystem>

namespace stiction::bench {

namespace {

/// Environment e of a batch on the host, by itself.
JacobianEnvironment<double> environment_at(const JacobianBatchView<double>& batch, Offset e) {
  JacobianEnvironment<double> env;
  const Offset row = batch.env_row_offsets[e], cone = batch.env_cone_offsets[e];
  const Index rows = batch.env_rows(e);
  for (Offset c = cone; c < cone + batch.env_cones(e); ++c)
    env.cones.push_back(
        {batch.cone_kind[c], static_cast<Index>(batch.cone_row_offsets[c + 1] - batch.cone_row_offsets[c])});
  const Offset begin = batch.row_offsets[row], end = batch.row_offsets[row + rows];
  env.J.assign(batch.J + begin, batch.J + end);
  if (batch.column != nullptr) {
    env.column.assign(batch.column + begin, batch.column + end);
    for (Offset i = row; i <= row + rows; ++i)
      env.row_offsets.push_back(static_cast<Index>(batch.row_offsets[i] - begin));
  }
  const auto part = [](const double* numbers, Offset first, Offset last) {
    return numbers == nullptr ? std::vector<double>() : std::vector<double>(numbers + first, numbers + last);
  };
  env.M = part(batch.M, batch.env_mass_offsets[e], batch.env_mass_offsets[e + 1]);
  env.v_free = part(batch.v_free, batch.env_dof_offsets[e], batch.env_dof_offsets[e + 1]);
  env.target = part(batch.target, row, row + rows);
  env.R = part(batch.R, row, row + rows);
  env.mu = part(batch.mu, row, row + rows);
  env.lo = part(batch.lo, row, row + rows);
  env.hi = part(batch.hi, row, row + rows);
  return env;
}

std::vector<double> dense(const scenes::Csr& matrix, Index columns) {
  const std::size_t rows = matrix.ptr.size() - 1, width = static_cast<std::size_t>(columns);
  std::vector<double> all(rows * width, 0.0);
  for (std::size_t i = 0; i < rows; ++i)
    for (auto k = static_cast<std::size_t>(matrix.ptr[i]); k < static_cast<std::size_t>(matrix.ptr[i + 1]); ++k)
      all[i * width + static_cast<std::size_t>(matrix.col[k])] += matrix.val[k];
  return all;
}

}  // namespace

template <class Real>
JacobianBatch<Real> JacobianCase::batch(std::size_t count) const {
  JacobianBatch<Real> all(law, MassForm::matrix, mass_block);
  for (std::size_t e = 0; e < count; ++e) {
    const JacobianEnvironment<double>& env = envs[e % envs.size()];
    const auto part = [](const std::vector<double>& numbers) {
      return std::vector<Real>(numbers.begin(), numbers.end());
    };
    JacobianEnvironment<Real> own{{},           env.row_offsets,  env.column,       part(env.J),
                                  part(env.M),  part(env.v_free), part(env.target), part(env.R),
                                  part(env.mu), part(env.lo),     part(env.hi)};
    for (const auto& cone : env.cones) own.cones.push_back({cone.kind, cone.row_count});
    all.add(own);
  }
  return all;
}
template JacobianBatch<float> JacobianCase::batch(std::size_t) const;
template JacobianBatch<double> JacobianCase::batch(std::size_t) const;

JacobianCase recorded_case(const std::string& path, std::size_t most) {
  const auto batch = io::jacobian_batch<double>(io::read_batch(path));
  const auto view = batch.view();
  JacobianCase found{std::filesystem::path(path).stem().string(), view.law, view.mass_block, {}};
  for (Offset e = 0; e < view.env_count && found.envs.size() < most; ++e)
    if (view.env_rows(e) > 0) found.envs.push_back(environment_at(view, e));
  return found;
}

JacobianCase scene_case(const std::string& scene, std::size_t count) {
  const auto infos = scenes::list();
  const auto info = std::find_if(infos.begin(), infos.end(), [&](const auto& one) { return one.name == scene; });
  JacobianCase found{scene, info == infos.end() ? Law::convex : info->law, 0, {}};
  for (std::uint64_t index = 0; found.envs.size() < count; ++index) {
    const scenes::SceneEnv made = scenes::make(scene, 1, index);
    const Environment<double>& system = made.system;
    if (system.b.empty()) continue;
    double diagonal = 0.0;
    const std::size_t rows = system.b.size();
    for (std::size_t i = 0; i < rows; ++i)
      for (auto k = static_cast<std::size_t>(system.row_offsets[i]);
           k < static_cast<std::size_t>(system.row_offsets[i + 1]); ++k)
        if (static_cast<std::size_t>(system.column[k]) == i) diagonal += system.A[k] / static_cast<double>(rows);
    JacobianEnvironment<double> env;
    for (const auto& cone : system.cones) env.cones.push_back({cone.kind, cone.row_count});
    env.J = dense(made.J, made.dof_count);
    env.M = dense(made.M, made.dof_count);
    env.v_free = made.v_free;
    env.target = made.row_target;
    env.R.assign(rows, 1e-4 * diagonal);
    env.mu = system.mu;
    env.lo = system.lo;
    env.hi = system.hi;
    found.envs.push_back(env);
  }
  return found;
}

}  // namespace stiction::bench
