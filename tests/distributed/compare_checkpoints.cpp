// compare_checkpoints A B: whether two checkpoints, read by the ordinary reader, hold the same bits. Exit status 0,
// or 1.
#include <cstdio>
#include <cstring>
#include <vector>

#include "stiction/io.hpp"

namespace {

template <class T>
bool is_same(const char* what, const std::vector<T>& a, const std::vector<T>& b) {
  const bool same = a.size() == b.size() && (a.empty() || std::memcmp(a.data(), b.data(), sizeof(T) * a.size()) == 0);
  if (!same) std::printf("%s: %zu and %zu numbers, of other bits\n", what, a.size(), b.size());
  return same;
}

}  // namespace

int main(int, char** argv) {
  const stiction::io::CheckpointFile a = stiction::io::read_checkpoint(argv[1]),
                                     b = stiction::io::read_checkpoint(argv[2]);
  const bool same = is_same("position", a.world.position, b.world.position) &&
                    is_same("orientation", a.world.orientation, b.world.orientation) &&
                    is_same("twist", a.world.twist, b.world.twist) &&
                    is_same("wrench", a.world.wrench, b.world.wrench) &&
                    is_same("contact_offsets", a.world.contact_offsets, b.world.contact_offsets) &&
                    is_same("contact_id", a.world.contact_id, b.world.contact_id) &&
                    is_same("impulse", a.world.impulse, b.world.impulse) && a.run == b.run && a.step == b.step &&
                    a.precision == b.precision;
  std::printf("%s: %zu bodies, %zu contacts\n", same ? "equal" : "not equal", b.world.position.size() / 3,
              b.world.contact_id.size());
  return same ? 0 : 1;
}
