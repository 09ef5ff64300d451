#!/bin/sh
# Process 1 of a machine with GNOME, before systemd takes its place: its file system, account and session, then systemd.
# In namespaces of its own (gnome_machine.py): mounts, processes, network, host name, System V IPC, control groups.
#   gnome_boot.sh LAYER WORK REPO PYTHON BIN
set -eu
layer=$1 work=$2 repo=$3 python=$4 bin=$5
mount --make-rprivate /
mount -t tmpfs tmpfs "$work"
mkdir "$work/below" "$work/root" "$work/up" "$work/work"
root=$work/root
# Two mounts: the layer lies in the file system that it is laid over, and two lower folders may not.
mount -t overlay overlay -o "lowerdir=/,upperdir=$layer/upper,workdir=$layer/work" "$work/below"
mount -t overlay overlay -o "lowerdir=$work/below,upperdir=$work/up,workdir=$work/work" "$root"
mount -t proc proc "$root/proc"
mount -t sysfs sysfs "$root/sys" -o ro
mount -t cgroup2 cgroup2 "$root/sys/fs/cgroup"
mount -t tmpfs tmpfs "$root/dev" -o mode=755
for name in null zero full random urandom tty; do
    touch "$root/dev/$name"
    mount --bind "/dev/$name" "$root/dev/$name"
done
mkdir "$root/dev/pts" "$root/dev/shm"
mount -t devpts devpts "$root/dev/pts" -o newinstance,ptmxmode=666,mode=620,gid=5
mount -t tmpfs tmpfs "$root/dev/shm" -o mode=1777
ln -s pts/ptmx "$root/dev/ptmx"
ln -s /proc/self/fd "$root/dev/fd"
for number in 0:stdin 1:stdout 2:stderr; do ln -s "fd/${number%:*}" "$root/dev/${number#*:}"; done
mount -t tmpfs tmpfs "$root/run"
mount -t tmpfs tmpfs "$root/tmp" -o mode=1777

# The account of OSWorld's machine.
name=$(chroot "$root" getent passwd 1000 | cut -d: -f1)
[ -z "$name" ] || chroot "$root" userdel "$name"
chroot "$root" useradd --uid 1000 --create-home --shell /bin/bash --groups sudo user
echo user:password | chroot "$root" chpasswd
mkdir -p "$root/home/user/Desktop" "$root/home/user/Documents"
chroot "$root" chown -R user:user /home/user

hostname user-vm
echo user-vm >"$root/etc/hostname"
echo '127.0.0.1 localhost user-vm' >"$root/etc/hosts"
echo 'nameserver 10.231.78.1' >"$root/etc/resolv.conf.new"
mv "$root/etc/resolv.conf.new" "$root/etc/resolv.conf"
echo 5a7d1e0c5b8f4c2e9d3a0f1b2c4d5e6f >"$root/etc/machine-id"
: >"$root/etc/fstab"
rm -f "$root/usr/sbin/policy-rc.d" "$root/.dockerenv"

system=$root/etc/systemd/system
for unit in console-getty.service systemd-networkd.service systemd-resolved.service systemd-timesyncd.service \
    systemd-udevd.service apt-daily.timer apt-daily-upgrade.timer; do ln -sf /dev/null "$system/$unit"; done
ln -sf /lib/systemd/system/graphical.target "$system/default.target"

# Accessibility is on, as on OSWorld's machine, and the screen neither blanks nor locks by itself.
mkdir -p "$root/etc/dconf/profile" "$root/etc/dconf/db/local.d"
printf 'user-db:user\nsystem-db:local\n' >"$root/etc/dconf/profile/user"
cat >"$root/etc/dconf/db/local.d/agenthijack" <<'DCONF'
[org/gnome/desktop/interface]
toolkit-accessibility=true
[org/gnome/desktop/session]
idle-delay=uint32 0
[org/gnome/desktop/background]
picture-options='none'
primary-color='#77216f'
color-shading-type='vertical'
secondary-color='#2c001e'
[org/gnome/shell]
enabled-extensions=['ding@rastersoft.com']
welcome-dialog-last-shown-version='99'
DCONF
chroot "$root" dconf update

# What the session consists of. It is a login session of PAM as GDM's would be, on Xvfb: GDM itself needs a virtual
# terminal for a session, but as a service it checks the password of the lock screen.
cat >"$root/usr/local/bin/gnome-on-xvfb" <<'SESSION'
#!/bin/sh
Xvfb :0 -screen 0 1920x1080x24 -nolisten tcp -noreset -s 0 -dpms &
until [ -S /tmp/.X11-unix/X0 ]; do sleep 0.1; done
exec gnome-session --session=gnome
SESSION
chmod 755 "$root/usr/local/bin/gnome-on-xvfb"
printf '[daemon]\nWaylandEnable=false\n' >"$root/etc/gdm3/daemon.conf"
cat >"$system/desktop.service" <<'UNIT'
[Unit]
Wants=gdm.service
After=gdm.service systemd-user-sessions.service
[Service]
User=user
PAMName=login
WorkingDirectory=/home/user
Environment=XDG_SESSION_TYPE=x11 XDG_SESSION_CLASS=user XDG_SEAT=seat0 XDG_SESSION_DESKTOP=gnome
Environment=XDG_CURRENT_DESKTOP=GNOME DESKTOP_SESSION=gnome DISPLAY=:0 LIBGL_ALWAYS_SOFTWARE=1 LANG=C.UTF-8
ExecStart=/usr/local/bin/gnome-on-xvfb
UNIT
# It loads all that it needs as root, then becomes the user; without a token only OSWorld's routes are open.
cat >"$system/guest.service" <<UNIT
[Unit]
After=desktop.service
[Service]
WorkingDirectory=$repo
Environment=DISPLAY=:0 XDG_RUNTIME_DIR=/run/user/1000 DBUS_SESSION_BUS_ADDRESS=unix:path=/run/user/1000/bus
Environment=HOME=/home/user USER=user LOGNAME=user LANG=C.UTF-8 XDG_CURRENT_DESKTOP=GNOME XDG_SESSION_TYPE=x11
Environment=PATH=$bin/bin:/usr/local/bin:/usr/bin:/bin PYTHONDONTWRITEBYTECODE=1
ExecStartPre=/bin/sh -c 'until [ -S /run/user/1000/bus ] && [ -S /tmp/.X11-unix/X0 ]; do sleep 0.1; done'
ExecStart=$python -m online_env.embedded.guest --osworld --user user --host 0.0.0.0 --port 5000 --bin $bin/bin
UNIT
mkdir -p "$system/graphical.target.wants"
for unit in desktop guest; do ln -sf "../$unit.service" "$system/graphical.target.wants/$unit.service"; done
mkdir -p "$root$bin"
cp -r "$repo/online_env/embedded/guest/bin" "$repo/online_env/embedded/guest/shim" "$root$bin/"
rm -f "$root$bin/bin/show-desktop" "$root$bin/bin/xdg-open"

ip link set lo up
cd "$root"
mkdir -p mnt/old
pivot_root . mnt/old
umount -l /mnt/old
exec env -i container=lxc PATH=/usr/sbin:/usr/bin:/sbin:/bin /lib/systemd/systemd </dev/null >/dev/null 2>&1
