#include "estimator/effects/catalogue.h"

namespace plumbline {

const Effect& adc_code_step();
const Effect& adc_mains_pickup();
const Effect& adc_quantization();
const Effect& adc_stuck_bit();
const Effect& env_base_field();
const Effect& rig_axis_skew();
const Effect& rig_backlash();
const Effect& rig_base_roll();
const Effect& rig_delta_eccentricity();
const Effect& rig_delta_ellipticity();
const Effect& rig_delta_periodic();
const Effect& rig_h_eccentricity();
const Effect& rig_h_scale();
const Effect& rig_index_slip();
const Effect& rig_pose_outlier();
const Effect& rig_tilt_index();
const Effect& sensor_asymmetry();
const Effect& sensor_bias_step();
const Effect& sensor_cross_product();
const Effect& sensor_cubic();
const Effect& sensor_dead_zone();
const Effect& sensor_drift();
const Effect& sensor_hysteresis();
const Effect& sensor_quadratic();
const Effect& sensor_saturation();
const Effect& sensor_scale_drift();
const Effect& sensor_settling();
const Effect& sensor_temperature_bias();
const Effect& sensor_temperature_scale();
const Effect& sensor_warmup();

const std::vector<const Effect*>& effect_catalogue() {
  static const std::vector<const Effect*> catalogue = {
      &adc_code_step(),
      &adc_mains_pickup(),
      // Where the codes prove either, the first of these two stands.
      &adc_stuck_bit(),
      &adc_quantization(),
      &env_base_field(),
      &rig_axis_skew(),
      &rig_backlash(),
      &rig_base_roll(),
      &rig_delta_eccentricity(),
      &rig_delta_ellipticity(),
      &rig_delta_periodic(),
      &rig_h_eccentricity(),
      &rig_h_scale(),
      &rig_index_slip(),
      &rig_pose_outlier(),
      &rig_tilt_index(),
      &sensor_asymmetry(),
      &sensor_bias_step(),
      &sensor_cross_product(),
      &sensor_cubic(),
      &sensor_dead_zone(),
      &sensor_drift(),
      &sensor_hysteresis(),
      &sensor_quadratic(),
      &sensor_saturation(),
      &sensor_scale_drift(),
      &sensor_settling(),
      &sensor_temperature_bias(),
      &sensor_temperature_scale(),
      &sensor_warmup(),
  };
  return catalogue;
}

}  // namespace plumbline
