// Foot placement: by how far the coming footholds move when the robot was pushed.
//
// A linear inverted pendulum over a fixed centre of pressure diverges along its capture point xi = c + v / w, w^2 = g / z, alone:
//   xi' = w (xi - zmp)
// An error e of it has grown to e exp(w T) when the next foot lands, T from now, unless the centre of pressure moves within the soles. What
// that can hold (`hold`, in the axes of the heading) is left to the soles; for what is beyond, the foot lands further out:
//   shift = gain (e - clamp(e, -hold, hold)) exp(w T)      within reach, no faster than a swinging foot can follow
// Source: Pratt et al., Capture point: a step toward humanoid push recovery (Humanoids 2006); Englsberger et al., Three-dimensional bipedal
// walking control based on divergent component of motion (T-RO 2015).
#ifndef CONTROLLER_LOOP_LOOP_CAPTURE_H_
#define CONTROLLER_LOOP_LOOP_CAPTURE_H_

#include <algorithm>
#include <cmath>

namespace engram {

// Law: gain; hold (2) [m]; reach [m]; rate [m/s].
template <class Law> class CaptureStep {
 public:
  const double (&shift() const)[2] { return shift_; }  // m, world axes
  void clear() { shift_[0] = shift_[1] = 0.0; }

  // error: of the capture point, seen less planned over the footholds as they are [m], world axes; yaw: heading [rad];
  // grows: exp(w T); dt: since the last update [s].
  void update(const double (&error)[2], double yaw, double grows, double dt) {
    const double c = std::cos(yaw), s = std::sin(yaw);
    const double e[2] = {error[0] + shift_[0] / grows, error[1] + shift_[1] / grows};  // as if no foothold had moved yet
    const double local[2] = {c * e[0] + s * e[1], -s * e[0] + c * e[1]};
    double wanted[2];
    for (int i = 0; i < 2; ++i) {
      const double hold = Law::hold[i], beyond = local[i] - std::clamp(local[i], -hold, hold);
      wanted[i] = std::clamp(Law::gain * beyond * grows, -Law::reach, Law::reach);
    }
    const double moves = Law::rate * dt;
    const double world[2] = {c * wanted[0] - s * wanted[1], s * wanted[0] + c * wanted[1]};
    for (int i = 0; i < 2; ++i) shift_[i] = std::clamp(world[i], shift_[i] - moves, shift_[i] + moves);
  }

 private:
  double shift_[2] = {};
};

}  // namespace engram
#endif  // CONTROLLER_LOOP_LOOP_CAPTURE_H_
