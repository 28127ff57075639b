#pragma once

#include <concepts>
#include <cstddef>
#include <cstdint>

#include "core/base/real.hpp"
#include "core/base/strided.hpp"

namespace stiction::inline STICTION_ISA {

/// Most bytes of a value that the threads of a team exchange.
inline constexpr std::size_t kTeamValueBytes = 64;

/// The team of lanes that owns one environment. An algorithm is a sequence of phases over a Team (phases.hpp) and
/// never sees a thread, a warp or a barrier. One text hence runs on a GPU thread, a GPU block and a CPU core. In the
/// tests it runs on real threads made to disagree about speed.
///
///   rank(), size()   this lane and how many there are
///   sync()           all lanes have arrived and see each other's writes
///   broadcast(f)     lane 0 evaluates f, every lane gets the value; contains the syncs that this needs
///   combine(bits)    bitwise or over the lanes, on every lane
///   max(v)           the largest v over the lanes, on every lane; exact, so no order can change it
///   kRowTile         rows a lane takes at once in a matrix product; speed only
///   leaves<T>()      32 values of T shared by the lanes, for sums over a fixed tree (reduce.hpp)
template <class B>
concept Team = requires(B& team, double v, double (*evaluate)()) {
  { team.rank() } -> std::convertible_to<Index>;
  { team.size() } -> std::convertible_to<Index>;
  team.sync();
  { team.broadcast(evaluate) } -> std::convertible_to<double>;
  { team.combine(std::uint32_t{}) } -> std::convertible_to<std::uint32_t>;
  { team.max(v) } -> std::convertible_to<double>;
  { B::kRowTile } -> std::convertible_to<Index>;
  { team.template leaves<double>() } -> std::convertible_to<double*>;
};

/// A team of one: a CPU core (whose Real may be a Pack) or a single GPU thread.
struct SerialTeam {
  static constexpr Index kRowTile = 8;
  static STICTION_HD constexpr Index rank() { return 0; }
  static STICTION_HD constexpr Index size() { return 1; }
  STICTION_HD void sync() const {}
  template <class F>
  STICTION_HD auto broadcast(F&& f) const {
    return f();
  }
  STICTION_HD std::uint32_t combine(std::uint32_t bits) const { return bits; }
  template <class T>
  STICTION_HD T max(T value) const {
    return value;
  }
  template <class T>
  STICTION_HD T* leaves() const {
    return nullptr;
  }
};

}  // namespace stiction::inline STICTION_ISA
