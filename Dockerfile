# docker build --tag slamduel .
# docker run --rm --volume "$PWD/results:/data/results" slamduel run
FROM python:3.13-slim

# libgcc and libstdc++ serve numba and gtsam; the slim image has all else that the wheels need.
RUN apt-get update -qq \
    && apt-get install -qq --no-install-recommends libgcc-s1 libstdc++6 \
    && rm -rf /var/lib/apt/lists/*

COPY . /source
RUN python -m pip install --no-cache-dir --constraint /source/constraints.txt '/source[dask,parquet]' \
    && rm -rf /source

# Kernels are compiled at their first use and kept beside the package: here, once, and not in every container.
RUN bench run --quiet --dataset aruco-room,victoria-park --out /tmp/first && rm -rf /tmp/first

# Results belong to the user who runs the container (docker run --user "$(id -u):$(id -g)").
ENV MPLCONFIGDIR=/tmp XDG_CACHE_HOME=/tmp/cache
WORKDIR /data
ENTRYPOINT ["bench"]
CMD ["--help"]
