#pragma once

#include <vector>

#include "core/machine/contact_machine.hpp"
#include "cuda/machine/engine.hpp"

namespace stiction::cuda {

/// Bytes of matrix in a piece: enough to hide the launches behind, few enough that pieces overlap.
inline constexpr Offset kPieceBytes = Offset{8} << 20;

/// Lanes of a trace behind those of the engine's streams.
inline constexpr int kUploadLane = 8, kDownloadLane = 9;

/// Solves batches of the host. They are cut into pieces that pass through two buffers. One piece is packed and uploaded
/// while another is solved and a third downloaded. The answer is handed over at the end, all at once: a failure on the
/// way leaves the caller's arrays as they were.
class Staging {
 public:
  Staging(DeviceApi& api, Engine& engine, Offset piece_bytes = kPieceBytes);
  ~Staging();
  Staging(const Staging&) = delete;
  Staging& operator=(const Staging&) = delete;

  template <class Real>
  void solve(const SolveRequest<Real>& request);

 private:
  /// Memory in which a piece waits on its way to the device.
  struct Buffer {
    PinnedMemory host;
    DeviceMemory device;
    std::unique_ptr<Event> uploaded, solved;
  };

  template <class Real>
  void queue_pieces(const SolveRequest<Real>& request, const std::vector<Offset>& cuts);
  template <class Real>
  std::vector<Offset> cut(const SolveRequest<Real>& request) const;
  void finish() noexcept;

  DeviceApi& api_;
  Engine& engine_;
  Offset piece_bytes_;
  Buffer buffer_[2];
  PinnedMemory answer_host_;
  DeviceMemory answer_device_;
  Stream up_, compute_, down_;
};

}  // namespace stiction::cuda
