# Copyright 2026 dm_ros developers
# SPDX-License-Identifier: Apache-2.0

"""The page of ``watch`` in a browser, where one is installed: what an engineer sees and does."""

from contextlib import contextmanager
import json
import math
import re
import shutil
import signal

from processes import command, Forked
import pytest
from sensor_msgs.msg import JointState

from dm_ros.mechanism.variants import MECHANISMS
from dm_ros.watch.scene import Scene

webdriver = pytest.importorskip('selenium.webdriver')
Keys = pytest.importorskip('selenium.webdriver.common.keys').Keys
BROWSER, DRIVER = (next(filter(None, map(shutil.which, names)), None) for names in (
    ('chromium', 'chromium-browser', 'google-chrome'), ('chromedriver',)))
pytestmark = pytest.mark.skipif(not (BROWSER and DRIVER), reason='no Chromium with its driver')

PICTURE = "return document.getElementById('drawing').toDataURL()"
# the pictures of some frames, so that what turns has time to turn
PICTURES = """
const [count, id, done] = arguments, seen = [];
const look = () => {
  seen.push(document.getElementById(id).toDataURL());
  if (seen.length < count) setTimeout(() => requestAnimationFrame(look), 30);
  else done(new Set(seen).size);
};
requestAnimationFrame(look);
"""
# how far the teeth of each pair are from tooth in gap, 0 to 0.5 of the pitch, the worst of all
MESHING = """
const [scenes, done] = arguments;
import('/mechanism.js').then(({Mechanism}) => {
  const minus = (p, q) => p.map((x, i) => x - q[i]);
  const dot = (p, q) => p.reduce((sum, x, i) => sum + x * q[i], 0);
  // where a point of the world is among the teeth of a wheel, in pitches
  const phase = ({solid, frame}, angles, point) => {
    const {origin, axes: [, y, z]} = frame(angles), arm = minus(point, origin);
    return Math.atan2(dot(arm, z), dot(arm, y)) * solid.teeth / (2 * Math.PI);
  };
  const off = x => Math.abs(x - Math.round(x));
  let worst = 0, pairs = 0, turned = 0;
  for (const scene of scenes) {
    const mechanism = new Mechanism(scene.gears, scene);
    const wheels = mechanism.parts.filter(part => part.meshes.length);
    const found = new Map();
    for (let n = 0; n < 40; n++) {
      const angles = mechanism.angles(0.37 * n, -0.91 * n * (n % 3));
      for (const [mesh, points] of Object.entries(mechanism.contacts(angles))) {
        const own = wheels.filter(part => part.meshes.includes(mesh));
        const big = own.find(part => part.meshes.length === 1);
        const small = own.filter(part => part !== big);
        points.forEach((point, i) => {
          const one = phase(big, angles, point), other = phase(small[i], angles, point);
          const key = mesh + i, before = found.get(key) || [0, 0];
          // turned the same way, or against each other: one of them holds for a pair
          found.set(key, [Math.max(before[0], off(one - other + 0.5)),
            Math.max(before[1], off(one + other + 0.5))]);
          turned = Math.max(turned, off(one));
        });
      }
    }
    for (const errors of found.values()) {
      worst = Math.max(worst, Math.min(...errors));
      pairs += 1;
    }
  }
  done([worst, pairs, turned]);
}, error => done(String(error)));
"""


@pytest.fixture(scope='module')
def chromium():
    options = webdriver.ChromeOptions()
    options.binary_location = BROWSER
    for argument in ('--headless=new', '--no-sandbox', '--disable-gpu', '--disable-dev-shm-usage',
                     '--window-size=1280,800'):
        options.add_argument(argument)
    options.set_capability('goog:loggingPrefs', {'browser': 'ALL', 'performance': 'ALL'})
    driver = webdriver.Chrome(options=options,
                              service=webdriver.ChromeService(executable_path=DRIVER))
    driver.set_script_timeout(60.0)
    yield driver
    driver.quit()


class Screen:
    """The page in the browser."""

    def __init__(self, driver, url):
        self.driver, self.url = driver, url
        driver.get(url)

    def text(self, selector):
        """Return the text that is seen of an element."""
        return self.driver.find_element('css selector', selector).text

    def numbers(self, kind):
        """Return {shaft: number} of the labels."""
        found = self.driver.execute_script(
            f'return [...document.querySelectorAll("[data-{kind}]")].map('
            f'e => [e.dataset.{kind}, e.textContent])')
        return {shaft: float(text.split()[0].replace('\N{MINUS SIGN}', '-'))
                for shaft, text in found if text != '\N{EN DASH}'}

    def different(self, count, of='drawing'):
        """Return how many of some pictures in a row differ."""
        return self.driver.execute_async_script(PICTURES, count, of)

    def move(self, name, value):
        """Move a slider, as a hand does."""
        self.driver.execute_script("""
            const slider = document.querySelector(
                `#control input[type=range][name=${arguments[0]}]`);
            slider.value = arguments[1];
            slider.dispatchEvent(new Event('input', {bubbles: true}));""", name, value)

    def type(self, name, *keys):
        """Type into the field of a port, over what it has."""
        field = self.driver.find_element('css selector', f'#control input[type=text][name={name}]')
        field.send_keys(Keys.CONTROL, 'a')
        field.send_keys(*keys)

    def port(self, name):
        """Return what slider and field of a port show: [least, most, value, text, untouched]."""
        return self.driver.execute_script("""
            const [slider, field] = document.querySelectorAll(
                `#control input[name=${arguments[0]}]`);
            return [...['min', 'max', 'value'].map(key => Number(slider[key])), field.value,
                slider.parentElement.className === 'untouched'];""", name)

    def press(self, words):
        """Press a button."""
        self.driver.execute_script("""
            [...document.querySelectorAll('#control button')].find(
                button => button.textContent === arguments[0]).click();""", words)


@pytest.fixture
def screen(ros, chromium):
    """Return a function that starts ``watch`` and opens its page, without errors in the end."""
    processes = []
    chromium.get('about:blank')
    for kind in ('browser', 'performance'):
        chromium.get_log(kind)   # of others

    def screen(*arguments):
        processes.append(Forked(command('watch'), '--port', 0, *arguments))
        processes[-1].says('/\n')
        url = re.search(r'http\S+', processes[-1].output).group()
        return Screen(chromium, url)
    yield screen
    urls = [message['params']['request']['url'] for entry in chromium.get_log('performance')
            if (message := json.loads(entry['message'])['message'])['method']
            == 'Network.requestWillBeSent']
    own = re.search(r'http\S+', processes[-1].output).group()
    errors = chromium.get_log('browser')
    chromium.get('about:blank')
    for process in processes:
        process.__exit__()
    assert len(urls) > 10 and not [url for url in urls if not url.startswith(own)]
    assert not errors


@pytest.mark.parametrize('variant, shaft', [('symmetric_ode', 'left'), ('lsd_ode', 'rear')])
def test_the_picture_turns_as_the_shafts_do_and_stands_while_paused(ros, screen, variant, shaft):
    node = ros.differential(variant, **{f'initial_velocity__{shaft}': 30.0})
    it = screen()
    ros.until(lambda: it.text('#state') == 'running')
    ros.until(lambda: it.different(8) > 4)
    assert node.control.running.is_set()
    node.control.running.clear()
    ros.until(lambda: it.different(4) == 1)
    ros.until(lambda: it.text('#state') == 'paused')
    assert it.different(12) == 1
    node.control.running.set()
    ros.until(lambda: it.different(8) > 4)


def test_a_shaft_that_stands_is_drawn_so(ros, screen):
    ros.differential()
    it = screen()
    ros.until(lambda: it.text('#state') == 'running')
    ros.until(lambda: it.different(4) == 1)
    assert len(it.driver.execute_script(PICTURE)) > 10_000   # there is a picture


@pytest.mark.parametrize('variant', ['symmetric_ode', 'lsd_ode'])
def test_the_labels_have_speeds_and_torques_of_the_topics(ros, screen, variant):
    shaft = MECHANISMS[variant.split('_')[0]].outputs[1]
    node = ros.differential(variant, mode='lockstep', **{f'initial_velocity__{shaft}': 12.0})
    joints = ros.listen(JointState, '/differential/joint_states')
    it = screen()
    ros.until(lambda: it.text('#state') == 'waits for messages on ~/torques')
    first, second, third = node.simulation.inputs
    torques = ros.publisher(JointState, '/differential/torques')
    torques.publish(JointState(name=[first, second, third], effort=[40.0, -12.5, -3.25]))
    ros.until(lambda: joints and it.numbers('speed'))
    for name, array in (('speed', joints[-1].velocity), ('torque', joints[-1].effort)):
        expected = dict(zip(joints[-1].name, array))
        for shaft, told in it.numbers(name).items():
            assert told == pytest.approx(expected[shaft], rel=1e-3, abs=6e-4), shaft
    assert set(it.numbers('speed')) == set(node.simulation.shafts)


def test_a_slider_reaches_the_topic_and_zero_all_takes_it_back(ros, screen):
    node = ros.differential('lsd_ode')
    messages = []
    ros.node.create_subscription(JointState, '/differential/torques', messages.append, 1000)
    it = screen('--control')
    ros.until(lambda: it.text('#state') == 'running')
    it.move('carrier', 80)
    it.move('rear_clutch', 400)
    ros.until(lambda: messages and len(messages[-1].name) == 2)
    commanded = dict(zip(messages[-1].name, messages[-1].effort))
    assert commanded == {'carrier': pytest.approx(80.0, abs=1.0),
                         'rear_clutch': pytest.approx(400.0, abs=10.0)}
    ros.until(lambda: it.numbers('torque')['carrier'] == commanded['carrier'])
    it.press('Zero all')
    ros.until(lambda: list(messages[-1].effort) == [0.0] * 5)
    it.press('Let go')
    count = len(messages)
    ros.until(lambda: node.plant.inputs.stale(node.simulation.ticks))
    assert len(messages) - count < 20 and not node.plant.inputs.refused


def test_a_typed_number_is_taken_by_enter_or_tab_and_zero_keeps_its_place(ros, screen):
    node = ros.differential('lsd_ode', torque_limit=20_000.0)
    it = screen('--control')
    ros.until(lambda: it.text('#state') == 'running')
    begin = it.port('carrier')
    assert begin == [-300, 300, 0, '0', True]
    for keys, words in (('1e9', 'not allowed'), ('1,5', 'decimal point'), ('x', 'a number'),
                        ('1e999', 'a number'), ('1,234.5', 'decimal point')):
        it.type('carrier', keys, Keys.ENTER)
        ros.until(lambda: words in it.text('#answer'))  # noqa: B023
        ros.until(lambda: it.port('carrier') == begin)
    it.type('carrier', '12345', Keys.ENTER)
    ros.until(lambda: it.port('carrier') == [-12345, 12345, 12345, '12345', False])
    ros.until(lambda: it.numbers('torque')['carrier'] == 12345)
    it.type('carrier', '\N{MINUS SIGN}2.5', Keys.TAB)
    ros.until(lambda: it.port('carrier')[3:] == ['-2.5', False])
    ros.until(lambda: it.numbers('torque')['carrier'] == -2.5)
    it.type('carrier', '1e9', Keys.ENTER)
    ros.until(lambda: 'not allowed' in it.text('#answer'))
    ros.until(lambda: it.port('carrier')[:2] + it.port('carrier')[3:]
              == [-12345, 12345, '-2.5', False])
    it.type('rear_clutch', '6000', Keys.ENTER)
    ros.until(lambda: it.port('rear_clutch') == [0, 6000, 6000, '6000', False])
    assert not node.plant.inputs.refused


def test_a_number_that_is_not_whole_is_never_commanded(ros, screen):
    ros.differential('lsd_ode')
    messages = []
    ros.node.create_subscription(JointState, '/differential/torques', messages.append, 1000)
    it = screen('--control')
    ros.until(lambda: it.text('#state') == 'running')
    button = {words: next(found for found in it.driver.find_elements('css selector', 'button')
                          if found.text == words) for words in ('Pause', 'Continue', 'Let go')}
    it.type('front', '7', Keys.ENTER)
    ros.until(lambda: it.port('front')[3:] == ['7', False])
    it.type('front', '70', Keys.ESCAPE)
    assert it.port('front')[3:] == ['7', False]
    for words in ('Pause', 'Continue'):
        it.type('front', '700')
        button[words].click()
        assert it.port('front')[3:] == ['7', False]
        ros.until(lambda: it.text('#answer').startswith(words.lower()))  # noqa: B023
    it.type('rear', '70')
    it.type('front', '700')
    button['Let go'].click()
    ros.until(lambda: it.text('#answer') == 'let go')
    for shaft in ('front', 'rear'):
        assert it.port(shaft)[2:] == [0, '0', True]
    ros.until(lambda: messages and list(messages[-1].effort) == [0.0])
    assert {(*message.name, *message.effort) for message in messages} == {
        ('front', 7.0), ('front', 0.0)}


def test_the_buttons_pause_step_and_go_on(ros, screen):
    node = ros.differential()
    it = screen('--control')
    ros.until(lambda: it.text('#state') == 'running')
    it.press('Pause')
    ros.until(lambda: not node.control.running.is_set())
    ticks = node.plant.ticks
    it.press('Step')
    ros.until(lambda: node.plant.ticks == ticks + 1)
    it.press('Continue')
    ros.until(lambda: node.control.running.is_set())
    ros.until(lambda: it.text('#answer') == 'continue: running')


def test_a_late_answer_does_not_hide_that_to_what_was_pressed_last(ros, screen):
    node = ros.differential()
    it = screen('--control')
    ros.until(lambda: it.text('#state') == 'running')
    it.driver.execute_script("""
        const direct = window.fetch;
        window.late = new Promise(done => { window.come = done; });
        window.fetch = async (url, options) => {
            const answer = await direct(url, options);
            if (!options.body.includes('pause')) return answer;
            await window.late;
            setTimeout(() => { window.came = true; }, 100);
            return answer;
        };""")
    it.press('Pause')
    ros.until(lambda: not node.control.running.is_set())
    it.press('Continue')
    ros.until(lambda: it.text('#answer') == 'continue: running')
    it.driver.execute_script('window.come();')
    ros.until(lambda: it.driver.execute_script('return window.came'))
    assert it.text('#answer') == 'continue: running'


def test_the_page_knows_at_once_that_it_paused_the_node_and_a_reset_lets_go(ros, screen):
    node = ros.differential()
    it = screen('--control')
    ros.until(lambda: it.text('#state') == 'running')
    it.press('Pause')
    ros.until(lambda: it.text('#state') == 'paused')
    it.driver.execute_script("""
        window.states = [];
        const state = document.getElementById('state');
        new MutationObserver(() => window.states.push(state.textContent))
            .observe(state, {childList: true});""")
    for _ in range(3):
        ticks = node.plant.ticks
        it.press('Step')
        ros.until(lambda: node.plant.ticks > ticks)  # noqa: B023
    it.type('left', '5', Keys.ENTER)
    ros.until(lambda: it.port('left')[3:] == ['5', False])
    it.press('Reset')
    ros.until(lambda: it.text('#answer').startswith('reset'))
    assert it.port('left')[2:] == [0, '0', True]
    ros.until(lambda: it.driver.execute_script('return window.states.length') > 8)
    assert set(it.driver.execute_script('return window.states')) == {'paused'}


def test_without_control_there_is_nothing_to_press(ros, screen):
    ros.differential()
    it = screen()
    ros.until(lambda: it.text('#state') == 'running')
    assert not it.driver.find_elements('css selector', 'button, input')


def test_a_warning_is_seen_at_once_and_its_values_unfold(ros, screen):
    ros.differential()
    it = screen()
    ros.until(lambda: it.text('#state') == 'running')
    publisher = ros.publisher(JointState, '/differential/torques')
    refused = JointState(name=['nobody'], effort=[1.0])

    def is_told():
        publisher.publish(refused)
        return 'torques: messages are refused' in it.text('#alarm')
    place = it.driver.find_element('id', 'picture').rect
    ros.until(is_told)
    assert it.driver.find_element('id', 'picture').rect == place
    alarm = it.driver.find_element('id', 'alarm')
    assert alarm.get_attribute('title') == alarm.text
    assert "'nobody'" not in it.text('#diagnostics')
    for summary in it.driver.find_elements('css selector', '#diagnostics summary'):
        summary.click()
    ros.until(lambda: "'nobody' is not one of pinion, left, right" in it.text('#diagnostics'))


def test_the_page_waits_for_a_node_and_finds_the_next_of_another_variant(ros, screen):
    it = screen()
    ros.until(lambda: 'ros2 run dm_ros differential' in it.text('#waiting'))
    for variant, shaft in (('lsd_ode', 'front'), ('symmetric_ode', 'pinion')):
        with Forked(command('differential'), '--ros-args', '-p', f'variant:={variant}') as node:
            ros.until(lambda: it.text('#kind').startswith(variant)  # noqa: B023
                      and shaft in it.numbers('speed'))  # noqa: B023
            node.ended(signal.SIGINT)
            ros.until(lambda: it.text('#state') == 'node gone')


STRIP = """
const values = [...document.querySelectorAll('[data-series]')].map(e => e.textContent);
return [...document.querySelectorAll('.uplot canvas')].map(e => e.toDataURL()).concat(values);
"""


# how many pixels of the strip of speeds have a colour, which axes and grid have not
COLOURED = """
const strip = document.querySelector('.uplot canvas');
const copy = new OffscreenCanvas(strip.width, strip.height);
const context = copy.getContext('2d', {willReadFrequently: true});
context.drawImage(strip, 0, 0);
const {data} = context.getImageData(0, 0, copy.width, copy.height);
let count = 0;
for (let i = 0; i < data.length; i += 4) {
  const rgb = data.slice(i, i + 3);
  count += data[i + 3] > 200 && Math.max(...rgb) - Math.min(...rgb) > 90;
}
return count;
"""


def test_a_single_tick_is_a_dot_in_the_strips(ros, screen):
    ros.differential('lsd_ode', mode='lockstep', initial_velocity__front=30.0)
    it = screen('--control')
    ros.until(lambda: it.text('#state') == 'waits for messages on ~/torques')
    assert it.driver.execute_script(COLOURED) == 0
    it.press('1 tick')
    ros.until(lambda: it.numbers('speed').get('front'))
    ros.until(lambda: it.driver.execute_script(COLOURED) > 3)


def test_the_drawing_and_the_strips_tell_the_same_tick(ros, screen):
    ros.differential('lsd_ode', initial_velocity__rear=30.0)
    it = screen('--control')
    ros.until(lambda: it.text('#state') == 'running' and it.numbers('speed').get('rear'))
    it.type('rear', '200', Keys.ENTER)
    seen = set()

    def changes():
        pair = it.driver.execute_script("""
            return ['[data-speed=rear]', '[data-series="speeds.rear"]'].map(
                query => document.querySelector(query).textContent);""")
        assert pair[0] == f'{pair[1]} rad/s'
        seen.add(pair[1])
        return len(seen) > 20
    ros.until(changes)


def test_what_was_seen_stays_when_the_node_goes_until_the_next_one_comes(ros, screen):
    it = screen()
    ros.until(lambda: it.text('#state') == 'waiting for the node')
    start = command('differential'), '--ros-args', '-p', 'variant:=lsd_ode'
    with Forked(*start, '-p', 'initial_velocity.rear:=30.0') as node:
        ros.until(lambda: it.text('#state') == 'running' and it.numbers('speed').get('rear'))
        ros.until(lambda: 'loop' in it.text('#diagnostics'))
        node.ended(signal.SIGINT)
    ros.until(lambda: it.text('#state') == 'node gone')
    assert 'Waiting for the node /differential.' in it.text('#waiting')
    ros.until(lambda: it.different(4) == 1)
    strips = it.driver.execute_script(STRIP)
    assert it.numbers('speed')['rear'] and it.text('#kind') and 'loop' in it.text('#diagnostics')
    assert len(it.driver.execute_script(PICTURE)) > 10_000
    assert it.driver.execute_script(STRIP) == strips and '\N{EN DASH}' not in strips
    with Forked(*start):
        ros.until(lambda: it.text('#state') == 'running' and it.numbers('speed').get('rear') == 0)
        assert not it.text('#waiting') and it.driver.execute_script(STRIP) != strips


@contextmanager
def width_of(driver, width, height=800):
    driver.execute_cdp_cmd('Emulation.setDeviceMetricsOverride', {
        'width': width, 'height': height, 'deviceScaleFactor': 1, 'mobile': False})
    yield
    driver.execute_cdp_cmd('Emulation.clearDeviceMetricsOverride', {})


@pytest.mark.parametrize('width', [360, 800, 1280])
def test_all_is_within_the_width_of_the_screen(ros, screen, chromium, width):
    ros.differential('lsd_ode', lsd__clutch__rear__friction_surfaces=3)
    with width_of(chromium, width):
        it = screen('--control')
        ros.until(lambda: it.text('#state') == 'running')
        ros.until(lambda: len(it.driver.find_elements('css selector', '.uplot canvas')) == 6)
        ros.until(lambda: it.driver.execute_script(
            'return document.documentElement.scrollWidth') <= width)
        boxes = it.driver.execute_script(
            'return [...document.querySelectorAll(".label")].map(e => e.getBoundingClientRect())')
        for n, one in enumerate(boxes):
            for other in boxes[:n]:
                assert (one['left'] >= other['right'] or other['left'] >= one['right']
                        or one['top'] >= other['bottom'] or other['top'] >= one['bottom'])


def test_the_teeth_mesh_wherever_the_shafts_are(ros, screen):
    values = [{'variant': 'symmetric_ode'}, {'variant': 'lsd_ode'}]
    values += [{'variant': 'symmetric_ode', 'symmetric.final_drive_ratio': ratio,
                'symmetric.satellite_count': count}
               for ratio in (-3.517, 2.2, -4.1) for count in (1, 3, 4)]
    values += [{'variant': 'lsd_ode', 'lsd.satellite_count': count, 'lsd.satellite_ratio': ratio}
               for count in (1, 2, 3, 5) for ratio in (0.3, 10 / 24)]
    worst, pairs, turned = screen().driver.execute_async_script(
        MESHING, [Scene('/d', value).description for value in values])
    assert pairs > 60 and turned > 0.4
    assert worst < 1e-9 and math.isfinite(worst)


# how many pixels of arrows of force are before and behind the middles of the front and rear wheels
FORCES = """
const canvas = document.getElementById('car'), {width, height} = canvas;
const dense = height / canvas.clientHeight;
const context = new OffscreenCanvas(width, height).getContext('2d', {willReadFrequently: true});
context.drawImage(canvas, 0, 0);
const {data} = context.getImageData(0, 0, width, height);
const force = [0xc4, 0x18, 0x6b];
return [0, 2].map(wheel => {
  const middle = dense * parseFloat(document.querySelectorAll('#wheels .label')[wheel].style.top);
  const counts = [0, 0];
  for (let i = 0; i < data.length; i += 4) {
    const away = Math.floor(i / 4 / width) - middle;
    if (Math.abs(away) < 60 * dense && force.every((x, k) => Math.abs(data[i + k] - x) < 8)) {
      counts[Number(away > 0)] += 1;
    }
  }
  return counts;
});
"""


def test_the_page_tells_how_to_start_a_driveline_that_it_waits_for(ros, screen, drive):
    it = screen('--node', 'driveline')
    ros.until(lambda: 'ros2 run dm_ros driveline' in it.text('#waiting'))
    name, effort = re.search(r'name: \[(\w+)\], effort: \[(.+?)\]', it.text('#waiting')).groups()
    node = drive()
    ros.publisher(JointState, '/driveline/commands').publish(
        JointState(name=[name], effort=[float(effort)]))
    ros.until(lambda: node.plant.inputs.received)
    assert not node.plant.inputs.refused


def test_a_car_goes_by_turns_its_wheels_and_stands_while_paused(ros, screen, drive):
    node = drive(planar=True, initial_speed=15.0)
    it = screen('--node', 'driveline')
    ros.until(lambda: it.text('#state') == 'running')
    assert it.text('#kind') == 'awd planar, 200 Hz, realtime'
    ros.until(lambda: it.different(8, 'car') > 4)
    node.control.running.clear()
    ros.until(lambda: it.different(12, 'car') == 1)
    node.control.running.set()
    ros.until(lambda: it.different(8, 'car') > 4)
    assert not it.driver.find_element('id', 'drawing').is_displayed()


def test_the_labels_of_wheels_have_the_numbers_of_the_topics(ros, screen, drive):
    drive(layout='rwd', planar=True, mode='lockstep', initial_speed=12.0)
    heard = {topic: ros.listen(JointState, f'/driveline/{topic}')
             for topic in ('joint_states', 'tyres')}
    it = screen('--node', 'driveline')
    ros.until(lambda: it.text('#state') == 'waits for messages on ~/commands')
    commands = ros.node.create_publisher(JointState, '/driveline/commands', 1000)
    ros.until(lambda: commands.get_subscription_count())

    def is_told():   # a message that is lost makes no tick: another one does
        if 'rear_left' in it.numbers('speed'):
            return True
        commands.publish(JointState(name=['input', 'steer'], effort=[900.0, math.nan],
                                    position=[math.nan, 0.08]))
        return False
    ros.until(is_told)

    def is_the_last():
        joints, tyres = (messages[-1] for messages in heard.values())
        speed, force = dict(zip(joints.name, joints.velocity)), dict(zip(tyres.name, tyres.effort))
        told = it.numbers('speed')
        wheels = [name for name in told if name != 'body']
        return len(wheels) == 4 and all(
            told[wheel] == pytest.approx(speed[wheel], rel=1e-3, abs=6e-4) and
            it.numbers('force')[wheel] == pytest.approx(math.hypot(
                force[f'{wheel}_longitudinal'], force[f'{wheel}_lateral']), abs=0.51)
            for wheel in wheels)
    ros.until(is_the_last)
    assert it.numbers('speed')['body'] == pytest.approx(12.0, abs=1.0)


def test_arrows_point_where_the_road_pushes_and_powers_have_their_direction(ros, screen, drive):
    drive(initial_speed=25.0)
    it = screen('--node', 'driveline')
    ros.until(lambda: it.text('#state') == 'running')
    commands = ros.node.create_publisher(JointState, '/driveline/commands', 10)

    def pushed(torque):
        commands.publish(JointState(name=['input'], effort=[torque]))
        (before, behind), (before_rear, behind_rear) = it.driver.execute_script(FORCES)
        power = it.numbers('power')
        way = -1 if torque < 0 else 1
        if way < 0:
            before, behind, before_rear, behind_rear = behind, before, behind_rear, before_rear
        return (before > 2 * behind + 20 and before_rear > 2 * behind_rear + 20
                and all(way * number > 1.0 for number in power.values()) and len(power) == 9)
    for torque in (900.0, -900.0):
        ros.until(lambda: pushed(torque))  # noqa: B023


def test_a_driveline_is_steered_by_a_slider(ros, screen, drive):
    node = drive(planar=True, initial_speed=5.0)
    it = screen('--node', 'driveline', '--control')
    ros.until(lambda: it.text('#state') == 'running')
    assert it.port('front_left_grip')[2:] == [pytest.approx(1.0), '1', True]
    it.type('front_left_grip', '0.2', Keys.ENTER)
    it.move('steer', 0.1)

    def held():
        return dict(zip(node.plant.inputs.names, node.plant.inputs.in_force(
            node.simulation.ticks)))
    ros.until(lambda: (held()['steer'], held()['front_left_grip']) == (
        pytest.approx(0.1, abs=2e-3), 0.2))
    it.move('rear_left_grip', 0)   # the least that there is, which is not 0
    ros.until(lambda: held()['rear_left_grip'] == 1e-6)
    it.press('Zero all')
    ros.until(lambda: held()['steer'] == 0.0 and held()['front_left_grip'] == 1.0)
    ros.until(lambda: it.port('front_left_grip')[3] == '1')
    assert not node.plant.inputs.refused


@pytest.mark.parametrize('width', [360, 1280])
def test_all_of_a_car_is_within_the_width_of_the_screen(ros, screen, chromium, drive, width):
    drive(planar=True, initial_speed=15.0)
    with width_of(chromium, width):
        it = screen('--node', 'driveline', '--control')
        ros.until(lambda: it.text('#state') == 'running' and it.numbers('speed'))
        ros.until(lambda: len(it.driver.find_elements('css selector', '.uplot canvas')) == 5)
        ros.until(lambda: it.driver.execute_script(
            'return document.documentElement.scrollWidth') <= width)
        boxes = it.driver.execute_script(
            'return [...document.querySelectorAll(".label")].map(e => e.getBoundingClientRect())')
        assert len(boxes) == 5
        for n, one in enumerate(boxes):
            for other in boxes[:n]:
                assert (one['left'] >= other['right'] or other['left'] >= one['right']
                        or one['top'] >= other['bottom'] or other['top'] >= one['bottom'])
