# The library and `hijack`, for pictures, datasets, training and scoring; no live desktop.
#   docker build -t agenthijack .
#   docker run --rm -v "$PWD":/work agenthijack demo --no-desktop
# Others than the extras hf and vision: docker build --build-arg EXTRAS=hf,vision,torch -t agenthijack .
FROM debian:12

RUN apt-get update \
 && apt-get install -y --no-install-recommends ca-certificates python3 python3-venv \
 && rm -rf /var/lib/apt/lists/*

ARG EXTRAS=hf,vision
COPY . /src
RUN python3 -m venv /opt/agenthijack \
 && /opt/agenthijack/bin/pip install --no-cache-dir "/src[$EXTRAS]" \
 && rm -rf /src

RUN useradd --create-home user
USER user
WORKDIR /work
ENV PATH=/opt/agenthijack/bin:$PATH
ENTRYPOINT ["hijack"]
CMD ["--help"]
