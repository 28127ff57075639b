#include "tests/cli/batches.hpp"

#include <utility>

#include "scenes/merge.hpp"

namespace stiction::test {

namespace {

Environment<double> chain(int index) {
  const Index cones = 1 + index % 3;
  const Index n = 3 * cones;
  const auto size = static_cast<std::size_t>(n);
  std::vector<double> A(size * size, 0.0);
  for (std::size_t i = 0; i < size; ++i) {
    A[i * size + i] = 2.0;
    if (i + 3 < size) A[i * size + i + 3] = A[(i + 3) * size + i] = -0.5;
  }
  Environment<double> environment;
  environment.cones.assign(static_cast<std::size_t>(cones), {ConeKind::friction, 3, -1});
  environment.set_dense(A, n);
  for (Index i = 0; i < n; ++i) {
    environment.b.push_back(i % 3 == 0 ? -1.0 - 0.125 * index : 0.25 * (i % 3));
    environment.mu.push_back(i % 3 == 0 ? 0.0 : 0.5);
  }
  environment.R.assign(size, 0.0625);
  return environment;
}

}  // namespace

io::Recording chain_recording(int count) {
  io::Recording recording;
  recording.batch = ContactBatch<double>(Law::convex);
  for (int i = 0; i < count; ++i) recording.batch.add(chain(i));
  recording.source = "a test";
  return recording;
}

io::Recording island_recording(int count) {
  io::Recording recording;
  for (int i = 0; i < count; ++i)
    recording.batch.add(scenes::merge({chain(i), chain(2 * i + 2)}, static_cast<std::uint64_t>(i)).system);
  recording.source = "a test";
  return recording;
}

io::Recording with_arrays(const io::Recording& recording, ContactBatch<double>::Arrays arrays) {
  io::Recording changed = recording;
  changed.batch = ContactBatch<double>::from_arrays(recording.batch.law(), std::move(arrays));
  return changed;
}

std::string write_batch(const std::string& path, const io::Recording& recording) {
  io::write_batch(path, recording);
  return path;
}

}  // namespace stiction::test
