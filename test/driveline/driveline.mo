// Copyright 2026 dm_ros developers
// SPDX-License-Identifier: Apache-2.0

// A driveline on its wheels by acausal parts, for a Modelica compiler to put together: which
// speed is a state, what follows from what and how, is its business. SI units. The parts have
// the default parameters of the driveline, but mesh_sign_speed, which is 0.1 rad/s.

connector Flange
  Real phi;
  flow Real tau;
end Flange;

model Source "a torque that drives a shaft"
  Flange a;
  Real torque;
equation
  a.tau = -torque;
end Source;

model Inertia
  Flange a;
  parameter Real J = 1;
  parameter Real start = 0;
  Real w(start = start, fixed = true);
equation
  w = der(a.phi);
  J*der(w) = a.tau;
end Inertia;

model Shaft "spring and damper with a gap, as ElastoBacklash of the Modelica Standard Library"
  Flange a;
  Flange b;
  parameter Real c = 1;
  parameter Real d = 1;
  parameter Real gap = 0;
  Real twist(start = 0, fixed = true);
  Real rate;
  Real spring;
  Real damper;
equation
  twist = a.phi - b.phi;
  rate = der(a.phi) - der(b.phi);
  spring = c*(twist - max(-gap/2, min(gap/2, twist)));
  damper = if gap > 0 then max(-abs(spring), min(abs(spring), d*rate)) else d*rate;
  b.tau = -(spring + damper);
  a.tau = spring + damper;
end Shaft;

model Mesh "gear pair with one loss for each tooth force, by the sign of the speed"
  parameter Real eta = 1;
  Real sigma "tanh of the speed";
  Real M;
  Real N;
  Real S;
equation
  N = (1 + eta)/2*M + (1 - eta)/2*abs(M)*sigma;
  S = (1 + eta)/2*M - (1 - eta)/2*abs(M)*sigma;
end Mesh;

model Clutch "friction of a side gear against the carrier"
  parameter Real surfaces = 0;
  parameter Real radius = 1;
  parameter Real arm = 1 "radius of the gear";
  parameter Real preload = 0;
  Real slip;
  Real M;
  Real F;
equation
  F = surfaces*0.15*radius*tanh(4*slip)*(abs(M)*tan(20*3.14159265358979323846/180)/arm + preload);
end Clutch;

model Bearing "loses a share of the moments that brake its shaft"
  parameter Real eta = 0.995;
  Real w;
  Real sigma;
  Real given "moment that the shaft gives to its far side";
  Real taken "moment that drives it";
  Real drag;
  Real loss;
  Real d;
equation
  d = if w > 0 then 1 else if w < 0 then -1 else 0;
  loss = (1/eta - 1)*sigma*max(0.0, max(0.0, d*given) + max(0.0, -d*taken) + d*drag);
end Bearing;

model Differential "bevel gears, the carrier's torque is that of the ring"
  Flange one;
  Flange two;
  parameter Real g12 = 1;
  parameter Real g2s = 0.5;
  parameter Real satellites = 2;
  parameter Real J0 = 0.1;
  parameter Real J1 = 1;
  parameter Real J2 = 1;
  parameter Real Js = 1;
  parameter Real start = 0;
  parameter Real sign_speed = 0.1;
  Real phi "of the carrier";
  Real w(start = start, fixed = true);
  Real w1(start = start);
  Real w2(start = start);
  Real ws(start = 0, fixed = true);
  Real ring "torque on the carrier";
  Real L0;
  Real L1;
  Real L2;
  Mesh m1(eta = 0.99);
  Mesh m2(eta = 0.99);
  Clutch c1;
  Clutch c2;
  Bearing bearing;
equation
  (1 + g12)*phi = one.phi + g12*two.phi;
  w = der(phi);
  w1 = der(one.phi);
  w2 = der(two.phi);
  ws = (w2 - w1)/(g2s*(1 + g12));
  m1.sigma = tanh(w1/sign_speed);
  m2.sigma = tanh(w2/sign_speed);
  c1.M = m1.M;
  c2.M = m2.M;
  c1.slip = w1 - w;
  c2.slip = w2 - w;
  L0 = 5e-3*w;
  L1 = 1e-3*(w1 - w);
  L2 = 1e-3*(w2 - w);
  bearing.w = w;
  bearing.sigma = tanh(w/sign_speed);
  bearing.given = m1.N + m2.N;
  bearing.taken = ring;
  bearing.drag = L0 - L1 - L2 - c1.F - c2.F;
  J1*der(w1) = m1.S - L1 - c1.F + one.tau;
  J2*der(w2) = m2.S - L2 - c2.F + two.tau;
  J0*der(w) = ring - m1.N - m2.N - bearing.drag - bearing.loss;
  satellites*Js/g2s*der(ws) = g12*m1.N - m2.N - satellites/g2s*1e-3*ws;
end Differential;

model Centre
  Flange a;
  extends Differential(g12 = 1.5, g2s = 10.0/24, satellites = 4, J0 = 2.9e-2, J1 = 4.8e-3,
    J2 = 5.8e-3, Js = 6.0e-3, c1(surfaces = 1, radius = 0.04, arm = 0.04, preload = 400),
    c2(surfaces = 9, radius = 0.06, arm = 0.06, preload = 400));
equation
  a.phi = phi;
  a.tau = ring;
end Centre;

model Axle
  Flange a;
  extends Differential(J1 = 4.18e-3, J2 = 4.18e-3, Js = 4.0e-5);
  parameter Real ratio = 3.517;
  Mesh final_drive(eta = 0.975);
  Bearing pinion;
equation
  a.phi = ratio*phi;
  final_drive.sigma = bearing.sigma;
  ring = final_drive.S;
  pinion.w = ratio*w;
  pinion.sigma = bearing.sigma;
  pinion.given = final_drive.N/ratio;
  pinion.taken = a.tau;
  pinion.drag = 1e-3*ratio*w;
  5.156e-3*ratio*der(w) = a.tau - pinion.drag - pinion.given - pinion.loss;
end Axle;

model Wheel "with brake and tyre, on a body that moves with vx, vy, r"
  Flange a;
  parameter Real x = 0;
  parameter Real y = 0;
  parameter Real grip = 1;
  parameter Real start = 0;
  parameter Real pad_start = 0;
  Real angle;
  Real brake;
  Real load;
  Real vx;
  Real vy;
  Real r;
  Real w(start = start, fixed = true);
  Real pad(start = pad_start, fixed = true);
  Real kappa(start = 0, fixed = true);
  Real alpha(start = 0, fixed = true);
  Real road_x;
  Real road_y;
  Real slip_x;
  Real slip_y;
  Real rolling;
  Real mu;
  Real px;
  Real py;
  Real rho;
  Real f;
  Real damping;
  Real Fx;
  Real Fy;
  Real bx;
  Real by;
  Real z;
  Real gives;
equation
  w = der(a.phi);
  road_x = (vx - r*y)*cos(angle) + (vy + r*x)*sin(angle);
  road_y = (vy + r*x)*cos(angle) - (vx - r*y)*sin(angle);
  slip_x = 0.32*w - road_x;
  slip_y = -road_y;
  rolling = 0.5*(abs(road_x) + abs(0.32*w) + sqrt(slip_x^2 + slip_y^2 + 1e-30));
  0.02*20*der(kappa) = slip_x - rolling*kappa;
  0.02*12*der(alpha) = slip_y - rolling*alpha;
  mu = grip*max(0.2, 1 - 0.1*(load/3900 - 1));
  px = 20*kappa/mu;
  py = 12*alpha/mu;
  rho = sqrt(px^2 + py^2 + 1e-20);
  f = sin(1.4*atan(rho/1.4));
  damping = 2/(1 + (rolling/0.25)^2)^2*(1 - f^2);
  Fx = mu*load*(f/rho*px + damping*slip_x);
  Fy = mu*load*(f/rho*py + damping*slip_y);
  bx = Fx*cos(angle) - Fy*sin(angle);
  by = Fx*sin(angle) + Fy*cos(angle);
  z = max(0.0, min(1.0, (abs(pad) - 0.7)/0.3));
  gives = if w*pad > 0 then z^2*(3 - 2*z) else 0;
  0.004*der(pad) = w - gives*abs(w)*pad;
  1.0*der(w) = a.tau - 0.32*Fx
    - (brake + 0.012*load*0.32)*(pad + 4/(1 + (w/0.25)^2)*(1 - pad^2)*w);
end Wheel;

model Body "mass on a slope with four wheels, whose loads follow the acceleration"
  parameter Real start = 0;
  parameter Real grade = 0;
  parameter Real pad_start = 0;
  parameter Real grip[4] = {1, 1, 1, 1};
  parameter Real contact[4] = {1, 1, 1, 1};
  Wheel w1(x = 1.25, y = 0.775, start = start/0.32, pad_start = pad_start, grip = grip[1]);
  Wheel w2(x = 1.25, y = -0.775, start = start/0.32, pad_start = pad_start, grip = grip[2]);
  Wheel w3(x = -1.4, y = 0.775, start = start/0.32, pad_start = pad_start, grip = grip[3]);
  Wheel w4(x = -1.4, y = -0.775, start = start/0.32, pad_start = pad_start, grip = grip[4]);
  Real steer;
  Real brake_front;
  Real brake_rear;
  Real vx(start = start, fixed = true);
  Real vy(start = 0, fixed = true);
  Real r(start = 0, fixed = true);
  Real Ax(start = 9.81*grade/sqrt(1 + grade^2), fixed = true);
  Real Ay(start = 0, fixed = true);
  Real position(start = 0, fixed = true);
  Real fx;
  Real fy;
  Real whole;
  Real front;
  Real rear;
  Real side;
equation
  fx = (w1.bx + w2.bx + w3.bx + w4.bx - 0.5*1.2*0.7*vx*abs(vx))/1600;
  fy = (w1.by + w2.by + w3.by + w4.by)/1600;
  der(vx) = fx + r*vy - 9.81*grade/sqrt(1 + grade^2);
  der(vy) = fy - r*vx;
  2500*der(r) = 1.25*(w1.by + w2.by) - 1.4*(w3.by + w4.by)
    + 0.775*(w2.bx + w4.bx - w1.bx - w3.bx);
  der(position) = vx;
  0.05*der(Ax) = fx - Ax;
  0.05*der(Ay) = fy - Ay;
  whole = 1600*9.81/sqrt(1 + grade^2);
  front = max(0.0, min(whole, (whole*1.4 - 1600*Ax*0.55)/2.65));
  rear = whole - front;
  side = 1600*Ay*0.55/1.55;
  w1.load = contact[1]*(front/2 - max(-front/2, min(front/2, 0.55*side)));
  w2.load = contact[2]*(front/2 + max(-front/2, min(front/2, 0.55*side)));
  w3.load = contact[3]*(rear/2 - max(-rear/2, min(rear/2, 0.45*side)));
  w4.load = contact[4]*(rear/2 + max(-rear/2, min(rear/2, 0.45*side)));
  w1.angle = atan(tan(steer)/(1 - 0.775*tan(steer)/2.65));
  w2.angle = atan(tan(steer)/(1 + 0.775*tan(steer)/2.65));
  w3.angle = 0;
  w4.angle = 0;
  w1.brake = brake_front;
  w2.brake = brake_front;
  w3.brake = brake_rear;
  w4.brake = brake_rear;
  w1.vx = vx;
  w2.vx = vx;
  w3.vx = vx;
  w4.vx = vx;
  w1.vy = vy;
  w2.vy = vy;
  w3.vy = vy;
  w4.vy = vy;
  w1.r = r;
  w2.r = r;
  w3.r = r;
  w4.r = r;
end Body;

model AllWheelDrive
  extends Body;
  Source source;
  Inertia engine(J = 1.8, start = 3.517*start/0.32);
  Shaft s_in(c = 3e4, d = 20);
  Centre centre(start = 3.517*start/0.32);
  Shaft s_front(c = 2e4, d = 15);
  Shaft s_rear(c = 1.5e4, d = 15);
  Axle front_axle(start = start/0.32);
  Axle rear_axle(start = start/0.32);
  Shaft h1(c = 1e4, d = 25);
  Shaft h2(c = 1e4, d = 25);
  Shaft h3(c = 1e4, d = 25);
  Shaft h4(c = 1e4, d = 25);
equation
  connect(source.a, engine.a);
  connect(engine.a, s_in.a);
  connect(s_in.b, centre.a);
  connect(centre.one, s_front.a);
  connect(centre.two, s_rear.a);
  connect(s_front.b, front_axle.a);
  connect(s_rear.b, rear_axle.a);
  connect(front_axle.one, h1.a);
  connect(front_axle.two, h2.a);
  connect(rear_axle.one, h3.a);
  connect(rear_axle.two, h4.a);
  connect(h1.b, w1.a);
  connect(h2.b, w2.a);
  connect(h3.b, w3.a);
  connect(h4.b, w4.a);
end AllWheelDrive;

partial model OneAxle "driven, of one axle; which wheels it drives says who extends this"
  extends Body;
  parameter Real gap = 0;
  parameter Real half_gap = 0;
  parameter Real c = 1e4;
  parameter Real d = 25;
  Source source;
  Inertia engine(J = 1.8, start = 3.517*start/0.32);
  Shaft s_in(c = 3e4, d = 20, gap = gap);
  Axle axle(start = start/0.32);
  Shaft left(c = c, d = d, gap = half_gap);
  Shaft right(c = c, d = d, gap = half_gap);
equation
  connect(source.a, engine.a);
  connect(engine.a, s_in.a);
  connect(s_in.b, axle.a);
  connect(axle.one, left.a);
  connect(axle.two, right.a);
end OneAxle;

model FrontWheelDrive
  extends OneAxle;
equation
  connect(left.b, w1.a);
  connect(right.b, w2.a);
end FrontWheelDrive;

model RearWheelDrive
  extends OneAxle;
equation
  connect(left.b, w3.a);
  connect(right.b, w4.a);
end RearWheelDrive;
