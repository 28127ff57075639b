#include "cuda/emulated/emulated_device.hpp"
#include "tools/gpu_first/target.hpp"

namespace stiction::gpu_first {

namespace {

class EmulatedTarget final : public Target {
 public:
  [[nodiscard]] Device device() const override { return Device::emulated(); }
  [[nodiscard]] std::shared_ptr<cuda::DeviceApi> api() const override { return device_; }
  [[nodiscard]] bool is_native() const override { return false; }
  void describe(JsonLine& line) const override {
    line.add("name", device_->facts().name).add("shared_bytes", device_->facts().shared_bytes);
  }
  std::function<void()> capture(cuda::StreamHandle stream, const std::function<void()>& queue) override {
    device_->begin_capture(stream);
    queue();
    return [device = device_, stream, graph = device_->end_capture(stream)] { device->launch(graph, stream); };
  }

 private:
  std::shared_ptr<cuda::EmulatedDevice> device_ = cuda::shared_emulated_device();
};

}  // namespace

std::unique_ptr<Target> make_emulated_target() {
  return std::make_unique<EmulatedTarget>();
}

}  // namespace stiction::gpu_first
