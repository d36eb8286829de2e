// MRPT's EKF-SLAM (CRangeBearingKFSLAM2D, in Davison's form, the cheapest it has) through the steps of a log.
//
// Standard input: steps to drive through before the clock runs, steps to time, standard deviation of ranges (m) and of
// bearings (rad); then a line a step: dx dy dtheta, the upper triangle of their covariance, how many sightings, and
// each of these as id range bearing. Arguments: s of CPU after which timing stops, and after which the first steps are
// given up. Standard output: ns of CPU of each step that was timed, then the last pose. Exit status 3: given up.
#include <mrpt/obs/CActionCollection.h>
#include <mrpt/obs/CActionRobotMovement2D.h>
#include <mrpt/obs/CObservationBearingRange.h>
#include <mrpt/obs/CSensoryFrame.h>
#include <mrpt/poses/CPosePDFGaussian.h>
#include <mrpt/slam/CRangeBearingKFSLAM2D.h>

#include <algorithm>
#include <cstdlib>
#include <ctime>
#include <iomanip>
#include <iostream>

using namespace mrpt::obs;
using namespace mrpt::poses;

static double cpu_s()
{
    timespec now;
    clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &now);
    return now.tv_sec + 1e-9 * now.tv_nsec;
}

int main(int, char** arguments)
{
    const double budget = std::atof(arguments[1]), patience = std::atof(arguments[2]);
    int before, timed;
    float range_sd, bearing_sd;
    std::cin >> before >> timed >> range_sd >> bearing_sd;
    mrpt::slam::CRangeBearingKFSLAM2D filter;
    filter.KF_options.method = mrpt::bayes::kfEKFAlaDavison;
    filter.KF_options.verbosity_level = mrpt::system::LVL_ERROR;
    filter.options.std_sensor_range = range_sd;
    filter.options.std_sensor_yaw = bearing_sd;
    double spent = 0;
    for (int k = 0; k < before + timed && spent < budget; k++)
    {
        CPosePDFGaussian motion;
        double dx, dy, turn;
        std::cin >> dx >> dy >> turn;
        motion.mean = CPose2D(dx, dy, turn);
        for (int i = 0; i < 3; i++)
            for (int j = i; j < 3; j++)
            {
                std::cin >> motion.cov(i, j);
                motion.cov(j, i) = motion.cov(i, j);
            }
        CActionRobotMovement2D moved;
        moved.poseChange = CPosePDFGaussian::Create(motion);
        auto action = std::make_shared<CActionCollection>();
        action->insert(moved);
        auto seen = std::make_shared<CObservationBearingRange>();
        seen->fieldOfView_yaw = 6.2832f;
        seen->sensor_std_range = range_sd;
        seen->sensor_std_yaw = bearing_sd;
        int sightings;
        std::cin >> sightings;
        for (; sightings > 0; sightings--)
        {
            CObservationBearingRange::TMeasurement sighting;
            std::cin >> sighting.landmarkID >> sighting.range >> sighting.yaw;
            sighting.pitch = 0;
            seen->maxSensorDistance = std::max(seen->maxSensorDistance, sighting.range + 1.0f);
            seen->sensedData.push_back(sighting);
        }
        auto frame = std::make_shared<CSensoryFrame>();
        frame->insert(seen);
        const double start = cpu_s();
        filter.processActionObservation(action, frame);
        const double end = cpu_s();
        if (k < before && end > patience) return 3;
        if (k >= before)
        {
            spent += end - start;
            std::cout << static_cast<long>(1e9 * (end - start)) << "\n";
        }
    }
    CPosePDFGaussian pose;
    filter.getCurrentRobotPose(pose);
    std::cout << "pose " << std::setprecision(9) << pose.mean.x() << " " << pose.mean.y() << " " << pose.mean.phi();
    std::cout << "\n";
    return std::cin ? 0 : 4;
}
