#include "tools/gpu_first/recorded.hpp"

#include <cstdint>
#include <fstream>

#include "stiction/error.hpp"

namespace stiction::gpu_first {

namespace {

constexpr char kMagic[] = "stiction recorded J and M 2\n";
constexpr std::uint64_t kMost = std::uint64_t{1} << 30;  ///< entries of an array that a file may claim

/// Calls f with every array, in the order of the file.
template <class Arrays, class F>
void for_each_array(Arrays& arrays, F&& f) {
  for (auto* const offsets : {&arrays.env_row_offsets, &arrays.env_cone_offsets, &arrays.env_dof_offsets,
                              &arrays.env_mass_offsets, &arrays.cone_row_offsets, &arrays.row_offsets})
    f(*offsets);
  f(arrays.cone_kind);
  f(arrays.column);
  for (auto* const numbers :
       {&arrays.J, &arrays.M, &arrays.v_free, &arrays.target, &arrays.R, &arrays.mu, &arrays.lo, &arrays.hi})
    f(*numbers);
}

/// Environment `env` of such arrays. Their offsets are sound where add() has checked or written them.
JacobianEnvironment<float> environment_of(const JacobianBatch<float>::Arrays& arrays, std::size_t env) {
  const auto part = [](const auto& all, Offset begin, Offset end) {
    using Vector = std::remove_cvref_t<decltype(all)>;
    if (all.empty()) return Vector();
    if (begin < 0 || end < begin || end > static_cast<Offset>(all.size()))
      throw Error(ErrorCode::io, "a recorded batch is damaged: make it anew by scripts/pack_for_gpu.sh");
    return Vector(all.begin() + begin, all.begin() + end);
  };
  JacobianEnvironment<float> own;
  const Offset row = arrays.env_row_offsets.at(env), end = arrays.env_row_offsets.at(env + 1);
  const auto first_cone = static_cast<std::size_t>(arrays.env_cone_offsets.at(env));
  for (std::size_t cone = first_cone; cone < static_cast<std::size_t>(arrays.env_cone_offsets.at(env + 1)); ++cone)
    own.cones.push_back({arrays.cone_kind.at(cone),
                         static_cast<Index>(arrays.cone_row_offsets.at(cone + 1) - arrays.cone_row_offsets.at(cone))});
  const Offset first = arrays.row_offsets.at(static_cast<std::size_t>(row));
  const Offset last = arrays.row_offsets.at(static_cast<std::size_t>(end));
  for (const Offset offset : part(arrays.row_offsets, row, end + 1))
    own.row_offsets.push_back(static_cast<Index>(offset - first));
  own.column = part(arrays.column, first, last);
  if (own.column.empty()) own.row_offsets.clear();
  own.J = part(arrays.J, first, last);
  own.M = part(arrays.M, arrays.env_mass_offsets.at(env), arrays.env_mass_offsets.at(env + 1));
  own.v_free = part(arrays.v_free, arrays.env_dof_offsets.at(env), arrays.env_dof_offsets.at(env + 1));
  own.target = part(arrays.target, row, end);
  own.R = part(arrays.R, row, end);
  own.mu = part(arrays.mu, row, end);
  own.lo = part(arrays.lo, row, end);
  own.hi = part(arrays.hi, row, end);
  return own;
}

}  // namespace

std::optional<JacobianBatch<float>> read_recorded(const std::string& folder, const std::string& name) {
  const std::string path = folder + "/" + name + ".batch";
  std::ifstream file(path, std::ios::binary);
  if (folder.empty() || !file) return std::nullopt;
  char magic[sizeof kMagic - 1];
  file.read(magic, sizeof magic);
  if (!file || std::string(magic, sizeof magic) != kMagic)
    throw Error(ErrorCode::io, path + " is no recorded batch: make it anew by scripts/pack_for_gpu.sh");
  std::int64_t block = 0;
  file.read(reinterpret_cast<char*>(&block), sizeof block);
  JacobianBatch<float>::Arrays arrays;
  for_each_array(arrays, [&](auto& array) {
    std::uint64_t count = 0;
    file.read(reinterpret_cast<char*>(&count), sizeof count);
    if (!file || count > kMost)
      throw Error(ErrorCode::io, path + " is damaged: make it anew by scripts/pack_for_gpu.sh");
    array.resize(count);
    file.read(reinterpret_cast<char*>(array.data()), static_cast<std::streamsize>(count * sizeof(array[0])));
  });
  if (!file) throw Error(ErrorCode::io, path + " ends early: make it anew by scripts/pack_for_gpu.sh");
  JacobianBatch<float> batch(Law::convex, MassForm::matrix, static_cast<Index>(block));
  for (std::size_t env = 0; env + 1 < arrays.env_row_offsets.size(); ++env) batch.add(environment_of(arrays, env));
  return batch;
}

void write_recorded(const std::string& path, const JacobianBatch<float>& batch) {
  std::ofstream file(path, std::ios::binary);
  file.write(kMagic, sizeof kMagic - 1);
  const std::int64_t block = batch.view().mass_block;
  file.write(reinterpret_cast<const char*>(&block), sizeof block);
  const auto& arrays = batch.arrays();
  for_each_array(arrays, [&](const auto& array) {
    const std::uint64_t count = array.size();
    file.write(reinterpret_cast<const char*>(&count), sizeof count);
    file.write(reinterpret_cast<const char*>(array.data()), static_cast<std::streamsize>(count * sizeof(array[0])));
  });
  if (!file.flush()) throw Error(ErrorCode::io, path + " cannot be written: is there room?");
}

JacobianBatch<float> repeated(const JacobianBatch<float>& batch, Offset envs) {
  std::vector<JacobianEnvironment<float>> own;
  for (std::size_t env = 0; env < static_cast<std::size_t>(batch.env_count()); ++env)
    own.push_back(environment_of(batch.arrays(), env));
  JacobianBatch<float> all(batch.view().law, batch.view().mass_form, batch.view().mass_block);
  for (Offset env = 0; env < envs; ++env) all.add(own[static_cast<std::size_t>(env) % own.size()]);
  return all;
}

}  // namespace stiction::gpu_first
